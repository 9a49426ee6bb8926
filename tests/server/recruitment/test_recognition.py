"""Entry links of each marketplace, and the ways back."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.recruitment.recognition import exit_link, recognise

PROLIFIC = {"PROLIFIC_PID": "5f0", "STUDY_ID": "s1", "SESSION_ID": "sub1"}
MTURK = {
    "workerId": "A1",
    "assignmentId": "as1",
    "hitId": "h1",
    "turkSubmitTo": "https://workersandbox.mturk.com",
}


def test_prolific_names_the_person_and_the_submission() -> None:
    arrival = recognise({**PROLIFIC, "utm_source": "x"})
    assert (arrival.marketplace, arrival.external_id, arrival.submission_id) == ("prolific", "5f0", "sub1")
    assert arrival.parameters == PROLIFIC


def test_mturk_names_the_worker_and_the_assignment() -> None:
    arrival = recognise(MTURK)
    assert (arrival.marketplace, arrival.external_id, arrival.submission_id) == ("mturk", "A1", "as1")
    assert not arrival.preview


@pytest.mark.parametrize("extra", [{}, {"workerId": "A1"}])
def test_a_hit_that_nobody_has_accepted_is_a_preview(extra: dict[str, str]) -> None:
    arrival = recognise({"assignmentId": "ASSIGNMENT_ID_NOT_AVAILABLE", "hitId": "h1", **extra})
    assert arrival.preview
    assert arrival.external_id is None


def test_a_prolific_link_with_open_placeholders_is_a_preview() -> None:
    assert recognise({"PROLIFIC_PID": "{{%PROLIFIC_PID%}}"}).preview


def test_without_a_marketplace_a_link_is_direct() -> None:
    arrival = recognise({"STUDY_ID": "s1"})
    assert (arrival.marketplace, arrival.external_id) == ("direct", None)


@given(st.text().filter(lambda text: not text.isascii() or not text.isprintable() or " " in text or not text))
def test_an_identifier_that_no_marketplace_sends_is_not_believed(value: str) -> None:
    assert recognise({"PROLIFIC_PID": value}).marketplace == "direct"


def test_prolific_gets_its_code_back() -> None:
    link = exit_link("prolific", "C 1", {}, None)
    assert link is not None
    assert link.url == "https://app.prolific.com/submissions/complete?cc=C+1"


def test_mturk_gets_a_form_with_the_assignment() -> None:
    link = exit_link("mturk", "C1", MTURK, None)
    assert link is not None
    assert link.url == "https://workersandbox.mturk.com/mturk/externalSubmit"
    assert link.fields == {"assignmentId": "as1", "code": "C1"}


@pytest.mark.parametrize(
    "host", ["https://evil.example", "https://www.mturk.com.evil.example", "javascript:x", ""]
)
def test_the_way_back_never_leads_to_a_host_that_the_link_made_up(host: str) -> None:
    assert exit_link("mturk", "C1", {**MTURK, "turkSubmitTo": host}, None) is None


def test_a_direct_study_returns_to_its_own_page_or_nowhere() -> None:
    link = exit_link("direct", "C1", {}, "https://example.edu/done?code={code}")
    assert link is not None
    assert link.url == "https://example.edu/done?code=C1"
    assert exit_link("direct", "C1", {}, "") is None
