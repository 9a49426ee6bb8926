"""Places: who was away too long comes back while one is free; a new submission opens the way again."""

from datetime import timedelta
from typing import Any

import pytest

from server.domain.participation import Event
from server.services import enrol, journey, lease, leave
from server.services.enrol import Enrolled, Entry
from server.services.lab import Lab
from server.services.session import session_of
from server.services.verify import verify
from server.storage import enrolments, journeys, participants
from server.storage.database import Database
from tests.fakes import FakeClock, definition, fake_lab
from tests.server.services.steps import DESKTOP, come_in, launch, person, prolific
from tests.server.services.walks import at_end, on, page, right, walk_to

SLUG = "traffic-junction"


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


@pytest.fixture
def lab(database: Database, clock: FakeClock) -> Lab:
    """A study with one arm that has one place, held for 30 minutes."""
    made = fake_lab(database, clock=clock)
    arm = definition(SLUG).arms[0].model_copy(update={"places": 1})
    launch(made, definition(SLUG, whole=True, trials_per_block=2, lease_min=30, arms=[arm]))
    return made


def try_to_enter(lab: Lab, name: str) -> Enrolled | Entry | Any:
    with lab.database.writing() as db:
        return enrol.consent(db, lab, SLUG, prolific(name), agree=True, device=DESKTOP)


def look(lab: Lab, key: str) -> bool:
    """Open one's page; whether one may go on."""
    with lab.database.writing() as db:
        return lease.keeps(db, lab, enrol.participant_by_key(db, lab, key))


def come_back(lab: Lab, key: str, name: str, submission: str) -> None:
    with lab.database.writing() as db:
        enrol.come_back(db, lab, key, prolific(name) | {"SESSION_ID": submission})


def told(lab: Lab, key: str, event: Event) -> None:
    with lab.database.writing() as db:
        who = participants.hold(db, enrol.participant_by_key(db, lab, key).id)
        journey.happen(db, lab, session_of(db, lab, who), event, "prolific")


def events(lab: Lab, key: str) -> list[tuple[str, str]]:
    with lab.database.reading() as db:
        return [(row.event, row.source) for row in journeys.of_participant(db, person(lab, key).id)]


def test_whoever_was_away_within_the_lease_keeps_the_place(lab: Lab, clock: FakeClock) -> None:
    key = come_in(lab, SLUG)
    clock.now += timedelta(minutes=29)
    assert isinstance(try_to_enter(lab, "bob"), Entry)
    assert look(lab, key)
    assert person(lab, key).status == "active"


def test_whoever_comes_back_late_goes_on_if_nobody_took_the_place(lab: Lab, clock: FakeClock) -> None:
    key = come_in(lab, SLUG)
    walk_to(lab, key, on("play"))
    clock.now += timedelta(hours=5)
    assert look(lab, key)
    assert page(lab, key).name == "play:1"
    assert isinstance(try_to_enter(lab, "bob"), Entry), "the place is held again"
    assert walk_to(lab, key, at_end).state == "finished"
    assert verify(lab).clean


def test_whoever_comes_back_after_the_place_was_taken_is_timed_out(lab: Lab, clock: FakeClock) -> None:
    key = come_in(lab, SLUG)
    walk_to(lab, key, on("play"))
    clock.now += timedelta(minutes=31)
    other = try_to_enter(lab, "bob")
    assert isinstance(other, Enrolled)
    assert not look(lab, key)
    assert (page(lab, key).state, page(lab, key).code) == ("timed_out", None)
    assert events(lab, key)[-1] == ("place_lost", "server")
    assert not look(lab, key)
    assert person(lab, other.key).status == "active"
    assert verify(lab).clean


def test_a_new_submission_does_not_bring_back_whose_place_is_still_taken(lab: Lab, clock: FakeClock) -> None:
    key = come_in(lab, SLUG, "ada")
    clock.now += timedelta(minutes=31)
    other = try_to_enter(lab, "bob")
    assert isinstance(other, Enrolled)
    look(lab, key)
    come_back(lab, key, "ada", "sub-2")
    assert person(lab, key).status == "timed_out"
    with lab.database.writing() as db:
        leave.withdraw(db, lab, enrol.participant_by_key(db, lab, other.key), keep=True)
    come_back(lab, key, "ada", "sub-3")
    assert person(lab, key).status == "active"
    assert events(lab, key)[-1] == ("took_again", "prolific")
    assert verify(lab).clean


def test_whoever_returned_and_took_a_place_again_goes_on_where_they_left(lab: Lab) -> None:
    key = come_in(lab, SLUG, "ada")
    walk_to(lab, key, on("play"))
    told(lab, key, Event.RETURN_TOLD)
    assert page(lab, key).state == "returned"
    assert not look(lab, key)
    come_back(lab, key, "ada", "sub-ada")
    assert person(lab, key).status == "returned", "the same submission is the one that was returned"
    come_back(lab, key, "ada", "sub-again")
    assert (person(lab, key).status, page(lab, key).name) == ("active", "play:1")
    with lab.database.reading() as db:
        assert enrolments.identity_of(db, person(lab, key).id).submission_id == "sub-again"
    assert walk_to(lab, key, at_end, right).state == "finished"
    assert verify(lab).clean


def test_returning_frees_the_place_for_somebody_else(lab: Lab) -> None:
    key = come_in(lab, SLUG, "ada")
    assert isinstance(try_to_enter(lab, "bob"), Entry)
    told(lab, key, Event.RETURN_TOLD)
    assert isinstance(try_to_enter(lab, "bob"), Enrolled)


@pytest.mark.parametrize("event", [Event.RETURN_TOLD, Event.TIME_OUT_TOLD, Event.REJECTION_TOLD])
def test_what_a_marketplace_tells_of_somebody_who_finished_changes_nothing(lab: Lab, event: Event) -> None:
    key = come_in(lab, SLUG)
    walk_to(lab, key, at_end)
    finished = person(lab, key)
    told(lab, key, event)
    assert person(lab, key) == finished
    assert verify(lab).clean


def test_nobody_comes_back_from_a_rejection(lab: Lab) -> None:
    key = come_in(lab, SLUG, "ada")
    told(lab, key, Event.REJECTION_TOLD)
    come_back(lab, key, "ada", "sub-2")
    assert page(lab, key).state == "rejected"
    assert not look(lab, key)
    assert verify(lab).clean
