"""Personal links: who is invited is recognised, and nobody can invite themselves."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.recruitment import personal
from server.recruitment.recognition import exit_link, marketplace_of, recognise

KEY = "a lab's secret"
NAMES = st.text(min_size=1, max_size=64).filter(lambda name: name.isprintable() and name == name.strip())


def read(code: str) -> str | None:
    return personal.name_of(code, "walk", KEY)


@given(NAMES)
def test_an_invitation_names_the_person_and_fits_into_a_link(name: str) -> None:
    code = personal.code_of(name, "walk", KEY)
    assert personal.CODE.fullmatch(code)
    assert read(code) == name
    assert personal.link("https://lab.example", "walk", code) == f"https://lab.example/s/walk?invite={code}"


def test_the_same_name_always_gets_the_same_link() -> None:
    assert personal.code_of("Ada", "walk", KEY) == personal.code_of("Ada", "walk", KEY)


@pytest.mark.parametrize("name", ["", " Ada", "a\nb", "x" * 65, "\ud800"])
def test_what_cannot_stand_on_a_list_gets_no_link(name: str) -> None:
    with pytest.raises(ValueError, match="cannot be a name"):
        personal.code_of(name, "walk", KEY)


@pytest.mark.parametrize(
    "code",
    [
        personal.code_of("Ada", "walk", "another lab's secret"),
        personal.code_of("Ada", "run", KEY),
        personal.code_of("Ada", "walk", KEY)[:-3],
        "Qm9i." + personal.code_of("Ada", "walk", KEY).partition(".")[2],
        "Ada",
        "",
        "x" * 501,
        "<script>",
    ],
)
def test_a_code_that_this_lab_did_not_write_for_this_study_is_a_forgery(code: str) -> None:
    arrival = recognise({"invite": code}, read)
    assert (arrival.marketplace, arrival.external_id, arrival.forged) == ("list", None, True)


def test_an_invitation_counts_before_whatever_else_the_link_says() -> None:
    code = personal.code_of("Ada", "walk", KEY)
    arrival = recognise({"invite": code, "PROLIFIC_PID": "5f0"}, read)
    assert (arrival.marketplace, arrival.external_id, arrival.forged) == ("list", "Ada", False)
    assert arrival.parameters == {"invite": code}


def test_without_the_key_no_invitation_is_believed() -> None:
    query = {"invite": personal.code_of("Ada", "walk", KEY)}
    assert recognise(query).forged
    assert marketplace_of(query) == "list"


def test_people_of_a_list_return_to_the_studys_own_page_or_nowhere() -> None:
    link = exit_link("list", "C1", {}, "https://example.edu/done?code={code}")
    assert link is not None
    assert link.url == "https://example.edu/done?code=C1"
    assert exit_link("list", "C1", {}, "") is None


def test_a_list_is_read_line_by_line_and_names_nobody_twice() -> None:
    assert personal.names_in(["Ada ", "", "Bob\r"]) == ["Ada", "Bob"]
    with pytest.raises(ValueError, match="'Ada' stands there twice"):
        personal.names_in(["Ada", "Bob", " Ada"])


def test_drawn_names_are_new_each_time() -> None:
    assert len({*personal.drawn(200), *personal.drawn(200)}) == 400
