"""What is Prolific's own: fields of a draft, races with participants, lost answers, money under bad luck."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from decimal import Decimal
from typing import Any

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import SecretStr

from server.recruitment.prolific_api import ProlificRecruiter
from server.recruitment.prolific_bonuses import BULK_MAX, SETTLED_S
from server.recruitment.prolific_http import Connection, LostError
from server.recruitment.prolific_lookup import sittings
from server.recruitment.prolific_wire import Sitting, Study, decimal, draft, read, time_limit_min
from server.recruitment.recruiter import RecruiterError, UncertainError
from server.simulate.fake_prolific import FakeProlific, running
from server.simulate.fake_prolific_market import Market
from tests.server.recruitment.contract import POSTING, Marketplace, Taken, bonus
from tests.server.recruitment.prolific_people import FakePeople

KEY = "t0k3n"
BONUS_LAG_S = 300.0
SUBMIT_LAG_S = 30.0


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    market = Market(7, bonus_lag_s=BONUS_LAG_S, submit_lag_s=SUBMIT_LAG_S, paying_s=0.05)
    with running(FakeProlific(KEY, market)) as served:
        yield served


@pytest.fixture(scope="module")
def connection(url: str) -> Iterator[Connection]:
    made = Connection(f"{url}/api/v1", SecretStr(KEY), transport=httpx.HTTPTransport(), sleep=lambda _: None)
    yield made
    made.close()


@pytest.fixture(scope="module")
def people(url: str) -> Iterator[FakePeople]:
    made = FakePeople(url)
    yield made
    made.close()


@pytest.fixture
def recruiter(connection: Connection) -> ProlificRecruiter:
    return ProlificRecruiter(connection)


@pytest.fixture
def study(recruiter: ProlificRecruiter, people: FakePeople) -> str:
    return Marketplace(recruiter, people).open_study().id


def finished(recruiter: ProlificRecruiter, people: FakePeople, study: str) -> Taken:
    taken = people.take(study)
    people.hand_in(taken, "CDONE")
    people.advance(SUBMIT_LAG_S)
    recruiter.approve(taken.submission_id)
    return taken


def body(**changes: Any) -> dict[str, Any]:
    options = {"approve_automatically": False, "screening": False, "project": None} | changes
    return draft(options.pop("posting", POSTING), **options)


# The draft


def test_a_draft_has_what_prolific_asks_for() -> None:
    made = body()
    assert made["external_study_url"] == (
        "https://study.example.org/s/traffic-junction"
        "?PROLIFIC_PID={{%PROLIFIC_PID%}}&STUDY_ID={{%STUDY_ID%}}&SESSION_ID={{%SESSION_ID%}}"
    )
    assert made["prolific_id_option"] == "url_parameters"
    assert made["completion_option"] == "url"
    assert made["device_compatibility"] == ["desktop"]
    assert (made["total_available_places"], made["reward"]) == (3, 300)
    assert (made["estimated_completion_time"], made["maximum_allowed_time"]) == (20, 60)
    assert "is_custom_screening" not in made


def test_an_entry_page_that_has_parameters_keeps_them() -> None:
    made = body(posting=replace(POSTING, entry_url="https://x.example/s/a?lang=en"))
    assert made["external_study_url"].startswith("https://x.example/s/a?lang=en&PROLIFIC_PID=")


@pytest.mark.parametrize(
    ("automatic", "expected"), [(False, "MANUALLY_REVIEW"), (True, "AUTOMATICALLY_APPROVE")]
)
def test_only_who_completed_can_be_paid_without_a_look(automatic: bool, expected: str) -> None:
    codes = {each["code"]: each for each in body(approve_automatically=automatic)["completion_codes"]}
    assert codes["CDONE"]["actions"] == [{"action": expected}]
    for code in ("CSCREEN", "CFAIL", "CLEFT"):
        assert codes[code]["actions"] == [{"action": "MANUALLY_REVIEW"}]
    assert {each["actor"] for each in codes.values()} == {"participant"}


@given(duration=st.integers(1, 300), limit=st.integers(1, 900))
def test_the_time_limit_is_ours_or_the_least_that_prolific_takes(duration: int, limit: int) -> None:
    given_min = time_limit_min(replace(POSTING, duration_min=duration, time_limit_min=limit))
    assert given_min >= limit
    assert given_min >= 2 + 2 * duration + 2 * duration**0.5
    assert given_min == limit or given_min - 1 < 2 + 2 * duration + 2 * duration**0.5


def test_a_draft_whose_answer_was_lost_is_found_again(
    recruiter: ProlificRecruiter, people: FakePeople
) -> None:
    people.plan_fault(match="POST /api/v1/studies/", status=502, when="after")
    posting = replace(POSTING, title="Lost and found")
    assert recruiter.create(posting) == recruiter.create(posting)


def test_a_draft_that_was_not_made_may_be_tried_again(
    recruiter: ProlificRecruiter, people: FakePeople
) -> None:
    people.plan_fault(match="POST /api/v1/studies/", status=502)
    posting = replace(POSTING, title="Not made")
    with pytest.raises(RecruiterError) as caught:
        recruiter.create(posting)
    assert caught.value.again
    assert recruiter.create(posting).state == "draft"


def test_a_code_that_approves_by_itself_pays(connection: Connection, people: FakePeople) -> None:
    recruiter = ProlificRecruiter(connection, approve_automatically=True)
    study = Marketplace(recruiter, people).open_study().id
    taken = people.take(study)
    people.hand_in(taken, "CDONE")
    people.advance(SUBMIT_LAG_S)
    assert people.rewards(taken) == 1
    recruiter.approve(taken.submission_id)
    assert people.rewards(taken) == 1


# States


def test_publishing_whose_answer_was_lost_is_published(
    recruiter: ProlificRecruiter, people: FakePeople
) -> None:
    made = recruiter.create(replace(POSTING, title="Published in the dark"))
    people.plan_fault(match=f"/studies/{made.id}/transition/", status=502, when="after")
    assert recruiter.publish(made.id).state == "active"


@pytest.mark.parametrize(
    ("status", "attempt", "again"),
    [("SCHEDULED", "publish", False), ("COMPLETED", "publish", False), ("PUBLISHING", "pause", True)],
)
def test_what_cannot_be_now_is_refused_before_it_is_asked(status: str, attempt: str, again: bool) -> None:
    with pytest.raises(RecruiterError) as caught:
        getattr(scripted({"id": "s1", "status": status, "total_available_places": 3}), attempt)("s1")
    assert caught.value.again is again


def scripted(*answers: Any) -> ProlificRecruiter:
    """A recruiter whose Prolific answers the questions in order: a body, or a status and a body."""
    todo = list(answers)

    def answer(_: httpx.Request) -> httpx.Response:
        said = todo.pop(0)
        status, content = said if isinstance(said, tuple) else (200, said)
        return httpx.Response(status, json=content)

    return ProlificRecruiter.open("https://p.example/api/v1", SecretStr(KEY), httpx.MockTransport(answer))


def sitting(status: str, **more: Any) -> dict[str, Any]:
    return {"id": "a1", "status": status, "study_id": "s1", "participant": "p1", **more}


@pytest.mark.parametrize(
    ("written", "state"),
    [
        ("TIMED-OUT", "timed_out"),
        ("TIMED_OUT", "timed_out"),
        ("AWAITING REVIEW", "awaiting_review"),
        ("AWAITING_REVIEW", "awaiting_review"),
        ("partially approved", "partially_approved"),
        ("SCREENED OUT", "screened_out"),
        ("UNKNOWN", "active"),
    ],
)
def test_a_state_is_known_in_every_spelling(written: str, state: str) -> None:
    assert read(Sitting, sitting(written)).state == state


def test_a_state_that_is_new_at_prolific_is_named() -> None:
    with pytest.raises(RecruiterError, match="HIBERNATING"):
        read(Sitting, sitting("HIBERNATING")).submission()
    with pytest.raises(RecruiterError, match="HIBERNATING"):
        read(Study, {"id": "s1", "status": "HIBERNATING"}).posted()


def test_an_answer_without_what_it_should_have_is_one_line() -> None:
    with pytest.raises(RecruiterError, match="status") as caught:
        scripted({"id": "s1"}).posted("s1")
    assert "\n" not in str(caught.value)


def test_no_code_is_no_code() -> None:
    assert read(Sitting, sitting("AWAITING REVIEW", study_code="NOCODE")).submission().code == ""
    assert read(Sitting, sitting("AWAITING REVIEW", study_code=None)).submission().code == ""


# Submissions


@pytest.mark.parametrize("announced", [True, False])
@pytest.mark.parametrize("size", [20, 100])
@pytest.mark.parametrize("count", [0, 1, 20, 41, 100, 101])
def test_pages_end_however_long_they_are_and_whatever_they_announce(
    announced: bool, size: int, count: int
) -> None:
    everybody = [{"id": f"a{n}", "participant_id": f"p{n}", "status": "ACTIVE"} for n in range(count)]

    def answer(request: httpx.Request) -> httpx.Response:
        first = size * (int(request.url.params["page"]) - 1)
        if first >= max(count, 1):
            return httpx.Response(404, json={"error": {"title": "Invalid page"}})
        told: dict[str, Any] = {"results": everybody[first : first + size]}
        return httpx.Response(200, json=told | ({"meta": {"count": count}} if announced else {}))

    made = Connection("https://p.example", SecretStr(KEY), transport=httpx.MockTransport(answer))
    assert list(sittings(made, "s1")) == [each["id"] for each in everybody]


def test_a_marketplace_that_repeats_its_last_page_does_not_hold_us_for_ever() -> None:
    page = {"results": [{"id": "a1", "participant_id": "p1", "status": "ACTIVE"}]}
    made = Connection(
        "https://p.example",
        SecretStr(KEY),
        transport=httpx.MockTransport(lambda _: httpx.Response(200, json=page)),
    )
    assert list(sittings(made, "s1")) == ["a1"]


def test_an_approval_before_the_code_arrived_is_tried_later(
    recruiter: ProlificRecruiter, people: FakePeople, study: str
) -> None:
    taken = people.take(study)
    people.hand_in(taken, "CDONE")
    with pytest.raises(RecruiterError) as caught:
        recruiter.approve(taken.submission_id)
    assert caught.value.again
    people.advance(SUBMIT_LAG_S)
    recruiter.approve(taken.submission_id)
    assert people.rewards(taken) == 1


@pytest.mark.parametrize("status", [502, 503])
def test_an_approval_whose_answer_was_lost_pays_once(
    recruiter: ProlificRecruiter, people: FakePeople, study: str, status: int
) -> None:
    taken = people.take(study)
    people.hand_in(taken, "CDONE")
    people.advance(SUBMIT_LAG_S)
    people.plan_fault(match=f"{taken.submission_id}/transition/", status=status, when="after")
    recruiter.approve(taken.submission_id)
    assert people.rewards(taken) == 1


def test_somebody_else_may_approve_faster() -> None:
    scripted(sitting("AWAITING REVIEW"), (400, {"error": {"detail": "no"}}), sitting("APPROVED")).approve(
        "a1"
    )


def test_a_refused_approval_says_prolifics_reason() -> None:
    answers = sitting("AWAITING REVIEW"), (400, {"error": {"detail": "no funds"}}), sitting("AWAITING REVIEW")
    with pytest.raises(RecruiterError, match="no funds"):
        scripted(*answers).approve("a1")


@pytest.mark.parametrize("status", ["RETURNED", "TIMED-OUT", "REJECTED", "SCREENED OUT"])
def test_what_cannot_be_approved_is_not_tried_again(status: str) -> None:
    with pytest.raises(RecruiterError) as caught:
        scripted(sitting(status)).approve("a1")
    assert not caught.value.again


def test_a_request_for_return_is_one_message_even_if_its_answer_is_lost(
    recruiter: ProlificRecruiter, people: FakePeople, study: str
) -> None:
    taken = people.take(study)
    people.plan_fault(match=f"{taken.submission_id}/request-return/", status=502, when="after", times=2)
    recruiter.ask_for_return(taken.submission_id, "You left early.")
    recruiter.ask_for_return(taken.submission_id, "You left early.")
    left = [each["times"] for each in people.faults() if taken.submission_id in each["match"]]
    assert left == [1]  # two were planned: one request was sent


def test_a_request_for_return_that_was_not_sent_may_be_tried_again(
    recruiter: ProlificRecruiter, people: FakePeople, study: str
) -> None:
    taken = people.take(study)
    people.plan_fault(match=f"{taken.submission_id}/request-return/", status=502)
    with pytest.raises(RecruiterError) as caught:
        recruiter.ask_for_return(taken.submission_id, "You left early.")
    assert caught.value.again


def test_nobody_is_screened_out_for_nothing(
    recruiter: ProlificRecruiter, people: FakePeople, study: str
) -> None:
    taken = people.take(study)
    with pytest.raises(RecruiterError, match="amount"):
        recruiter.screen_out(study, [taken.submission_id])


def test_screening_out_whose_answer_was_lost_is_not_done_twice(
    connection: Connection, people: FakePeople
) -> None:
    recruiter = ProlificRecruiter(connection, screen_out_minor=14)
    study = Marketplace(recruiter, people).open_study(places=1).id
    taken = people.take(study)
    people.plan_fault(match="screen-out-submissions", status=502, when="after")
    with pytest.raises(UncertainError):
        recruiter.screen_out(study, [taken.submission_id])
    recruiter.screen_out(study, [taken.submission_id])
    assert people.ledger()["submissions"][taken.submission_id]["screen_outs"] == [14]


# Money


@given(st.integers(0, 10**9))
def test_an_amount_is_written_exactly(amount_minor: int) -> None:
    assert Decimal(decimal(amount_minor)) * 100 == amount_minor
    assert decimal(amount_minor).split(".")[1].isdecimal()
    assert len(decimal(amount_minor).split(".")[1]) == 2


def test_what_was_paid_is_seen_after_a_while(
    recruiter: ProlificRecruiter, people: FakePeople, study: str
) -> None:
    paid, other = finished(recruiter, people, study), finished(recruiter, people, study)
    recruiter.pay_bonuses(study, [bonus(paid, 50, "r1"), bonus(paid, 20, "r2")])
    assert recruiter.paid_bonuses(study) == {paid.submission_id: (), other.submission_id: ()}
    people.advance(SETTLED_S)
    assert recruiter.paid_bonuses(study) == {paid.submission_id: (50, 20), other.submission_id: ()}
    assert recruiter.submission(paid.submission_id).bonus_minor == 70


def test_another_process_sees_what_was_paid_once_it_shows(
    recruiter: ProlificRecruiter, connection: Connection, people: FakePeople, study: str
) -> None:
    taken = finished(recruiter, people, study)
    wanted = [bonus(taken, 50, "r1"), bonus(taken, 50, "r2")]
    recruiter.pay_bonuses(study, wanted)
    people.advance(SETTLED_S)
    again = ProlificRecruiter(connection).pay_bonuses(study, [*wanted, bonus(taken, 50, "r3")])
    assert [each.request for each in again] == ["r1", "r2", "r3"]
    assert people.bonuses(taken) == [50, 50, 50]


def test_a_payment_of_an_earlier_process_is_not_taken_for_a_new_one_later(
    recruiter: ProlificRecruiter, connection: Connection, people: FakePeople, study: str
) -> None:
    taken = finished(recruiter, people, study)
    recruiter.pay_bonuses(study, [bonus(taken, 50, "r1")])
    people.advance(SETTLED_S)
    later = ProlificRecruiter(connection)
    for names in (("r2", "r1"), ("r1", "r2"), ("r2", "r1")):  # what is paid now does not show yet
        later.pay_bonuses(study, [bonus(taken, 50, name) for name in names])
    assert people.bonuses(taken) == [50, 50]


@pytest.mark.parametrize("when", ["before", "after"])
def test_money_whose_answer_was_lost_is_never_sent_again(
    recruiter: ProlificRecruiter, people: FakePeople, study: str, when: str
) -> None:
    taken = finished(recruiter, people, study)
    people.plan_fault(match="/pay/", status=502, when=when)
    for _ in range(3):
        with pytest.raises(UncertainError) as caught:
            recruiter.pay_bonuses(study, [bonus(taken, 50, "r1")])
        assert not caught.value.again
    assert people.bonuses(taken) == ([50] if when == "after" else [])


def test_money_whose_answer_was_lost_is_settled_once_it_shows(
    recruiter: ProlificRecruiter, people: FakePeople, study: str
) -> None:
    taken = finished(recruiter, people, study)
    people.plan_fault(match="/pay/", status=502, when="after")
    with pytest.raises(UncertainError):
        recruiter.pay_bonuses(study, [bonus(taken, 50, "r1")])
    people.advance(SETTLED_S)
    recruiter.pay_bonuses(study, [bonus(taken, 50, "r2"), bonus(taken, 50, "r1")])
    assert people.bonuses(taken) == [50, 50]


def test_money_that_was_refused_may_be_sent_again(
    recruiter: ProlificRecruiter, people: FakePeople, study: str
) -> None:
    taken = finished(recruiter, people, study)
    people.plan_fault(match="/pay/", status=400)
    with pytest.raises(RecruiterError) as caught:
        recruiter.pay_bonuses(study, [bonus(taken, 50, "r1")])
    assert not isinstance(caught.value, LostError | UncertainError)
    recruiter.pay_bonuses(study, [bonus(taken, 50, "r1")])
    assert people.bonuses(taken) == [50]


def test_two_at_once_are_paid_one_after_the_other(
    recruiter: ProlificRecruiter, people: FakePeople, study: str
) -> None:
    taken = finished(recruiter, people, study)
    requests = ["r1", "r2", "r1", "r2"]
    threads = [
        threading.Thread(target=recruiter.pay_bonuses, args=(study, [bonus(taken, 50, each)]))
        for each in requests
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert people.bonuses(taken) == [50, 50]


def test_units_that_were_misread_are_noticed_before_the_money_goes() -> None:
    recruiter = scripted(sitting("APPROVED"), (201, {"id": "b1", "total_amount": 7_000}))
    with pytest.raises(RecruiterError, match="nothing was paid"):
        recruiter.pay_bonuses("s1", [bonus(Taken("a1", "p1", ""), 50, "r1")])


@pytest.mark.parametrize("found", [{"study_id": "s2"}, {"participant": "p2"}])
def test_another_study_or_person_gets_nothing(found: dict[str, str]) -> None:
    with pytest.raises(RecruiterError, match="another"):
        scripted(sitting("APPROVED", **found)).pay_bonuses("s1", [bonus(Taken("a1", "p1", ""), 50, "r1")])


def test_a_bulk_is_no_larger_than_prolific_advises() -> None:
    wanted = [bonus(Taken("a1", "p1", ""), 50, f"r{n}") for n in range(BULK_MAX + 1)]
    with pytest.raises(RecruiterError, match=str(BULK_MAX)):
        scripted(sitting("APPROVED")).pay_bonuses("s1", wanted)


def test_a_name_is_not_used_for_something_else_later(
    recruiter: ProlificRecruiter, people: FakePeople, study: str
) -> None:
    taken = finished(recruiter, people, study)
    recruiter.pay_bonuses(study, [bonus(taken, 50, "r1")])
    with pytest.raises(RecruiterError, match="other contents"):
        recruiter.pay_bonuses(study, [bonus(taken, 60, "r1")])
    assert people.bonuses(taken) == [50]
