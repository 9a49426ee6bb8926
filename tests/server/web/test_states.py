"""Every state that somebody can be in, reached over the services, has a page that says what to do next."""

import re
from contextlib import suppress
from typing import Any

import pytest

from server.domain.participation import BEFORE, ENDS, STAGES, Event, State, after
from server.services import enrol, journey, leave, person_check
from server.services.lab import Lab
from server.services.session import session_of
from server.services.verify import verify
from server.storage import journeys, participants, trials
from server.storage.database import Database, DbSession
from tests.fakes import definition, fake_lab
from tests.server.services.steps import DESKTOP, launch, open_round, person, play_round, prolific
from tests.server.services.walks import (
    asked,
    at_end,
    careless,
    entered,
    hand_in,
    on,
    page,
    walk_to,
    wrong,
)
from tests.server.web.walk import client_of

SLUG = "parent-child"
TOLD = {
    State.RETURNED: Event.RETURN_TOLD,
    State.TIMED_OUT: Event.TIME_OUT_TOLD,
    State.REJECTED: Event.REJECTION_TOLD,
}
HEADINGS = {
    State.CONSENTED: r"Find the child in as few steps as you can|Help the parent to find you in few steps",
    State.PRACTISED: "A few questions about the game",
    State.SURVEYED: r"What does each sign tell\?",
    State.FINISHED: "Thank you, you are finished",
    State.FAILED: "Thank you, you are finished",
    State.SCREENED_OUT: "The study ends here for you",
    State.WITHDRAWN: "You have left the study",
    State.TIMED_OUT: "Your time for this study is over",
    State.RETURNED: "You have returned your place",
    State.REJECTED: "This session is closed",
}
NEXT = {
    State.CONSENTED: 'type="submit">Next</button>',
    State.INSTRUCTED: "round_url",
    State.PRACTISED: 'form="answers">Continue</button>',
    State.QUIZZED: "round_url",
    State.PLAYING: "round_url",
    State.SURVEYED: 'form="answers">Continue</button>',
    State.FINISHED: "FOUND-CHILD</output>",
    State.FAILED: "FOUND-CHILD-2</output>",
    State.SCREENED_OUT: "LOOKED-IN</output>",
    State.WITHDRAWN: "LEFT-EARLY</output>",
    State.TIMED_OUT: "its link brings you back to where you were",
    State.RETURNED: "its link brings you back here",
    State.REJECTED: "write to the research team",
}


@pytest.fixture
def lab(sqlite_database: Database) -> Lab:
    return fake_lab(sqlite_database)


def told(lab: Lab, key: str, event: Event) -> None:
    with lab.database.writing() as db:
        who = participants.hold(db, enrol.participant_by_key(db, lab, key).id)
        journey.happen(db, lab, session_of(db, lab, who), event, "prolific")


def into(lab: Lab, state: State) -> str:
    """Somebody in this state; the key of their session."""
    key = entered(lab, SLUG)
    ways: dict[State, Any] = {
        State.CONSENTED: lambda: None,
        State.INSTRUCTED: lambda: walk_to(lab, key, on("practice")),
        State.PRACTISED: lambda: walk_to(lab, key, asked("quiz")),
        State.QUIZZED: lambda: walk_to(lab, key, on("play")),
        State.PLAYING: lambda: play_on(lab, key),
        State.SURVEYED: lambda: walk_to(lab, key, asked("probe")),
        State.FINISHED: lambda: walk_to(lab, key, at_end),
        State.FAILED: lambda: walk_to(lab, key, at_end, careless),
        State.SCREENED_OUT: lambda: fail_the_quiz(lab, key),
        State.WITHDRAWN: lambda: withdraw(lab, key),
    }
    if state in TOLD:
        walk_to(lab, key, on("play"))
        told(lab, key, TOLD[state])
    else:
        ways[state]()
    return key


def play_on(lab: Lab, key: str) -> None:
    """One main round is over, and the check after it is answered."""
    walk_to(lab, key, on("play"))
    view = open_round(lab, key)
    assert isinstance(view, dict)
    play_round(lab, key, view)


def fail_the_quiz(lab: Lab, key: str) -> None:
    walk_to(lab, key, asked("quiz"))
    for _ in range(2):
        hand_in(lab, key, wrong(page(lab, key)))


def withdraw(lab: Lab, key: str) -> None:
    with lab.database.writing() as db:
        leave.withdraw(db, lab, enrol.participant_by_key(db, lab, key), keep=True)


def heading(text: str) -> str:
    [found] = re.findall(r"<h1[^>]*>([^<]*)</h1>", text)
    return found


IN_SESSION = [state for state in State if state not in {*BEFORE, State.DECLINED}]


@pytest.mark.parametrize("state", IN_SESSION)
def test_every_state_has_a_page_with_its_heading_and_the_next_step(lab: Lab, state: State) -> None:
    key = into(lab, state)
    assert page(lab, key).state is state
    client = client_of(lab)
    shown = client.get(f"/p/{key}")
    assert shown.status_code == 200
    assert NEXT[state] in shown.text
    if state in HEADINGS:
        assert re.fullmatch(HEADINGS[state], heading(shown.text))
    assert (state in ENDS) == ("Stop taking part" not in shown.text)
    entry = client.get(f"/s/{SLUG}", params=prolific("ada"))
    assert entry.headers["location"] == f"/p/{key}", "the link leads back to the same page"
    assert client.get(f"/p/{key}").text == shown.text
    assert verify(lab).clean


class UndoError(Exception):
    """Takes back what a test has done."""


@pytest.mark.parametrize("state", IN_SESSION)
def test_in_every_state_every_event_does_what_the_table_says(lab: Lab, state: State) -> None:
    key = into(lab, state)
    who = person(lab, key)
    for event in Event:
        with suppress(UndoError), lab.database.writing() as db:
            check_move(db, lab, who.id, state, event)
            raise UndoError
    assert person(lab, key) == who


def check_move(db: DbSession, lab: Lab, who: str, state: State, event: Event) -> None:
    session = session_of(db, lab, participants.hold(db, who))
    before = journeys.of_participant(db, who)
    wanted = after(state, event)
    if event is Event.TOOK_AGAIN and wanted is not state:
        wanted = State.QUIZZED  # the page that was left
    assert journey.happen(db, lab, session, event, "server") is wanted, event
    now = participants.by_id(db, who)
    assert now.status == (wanted.value if wanted in ENDS else "active"), event
    moved = [(row.event, row.state) for row in journeys.of_participant(db, who)[len(before) :]]
    assert moved == ([(event.value, wanted.value)] if wanted is not state else [])
    if event in {Event.WITHDRAW, Event.TOOK_AGAIN, Event.PLACE_LOST, *TOLD.values()}:
        rows = trials.of_participant(db, who)
        assert list(person_check.check(db, lab, session_of(db, lab, now), rows)) == []


def test_the_entry_page_asks_and_whoever_declines_or_does_not_fit_reads_what_to_do(lab: Lab) -> None:
    launch(lab, definition(SLUG, whole=True))
    client = client_of(lab)
    invited = client.get(f"/s/{SLUG}", params=prolific("ada"))
    assert invited.status_code == 200
    assert heading(invited.text) == "Before you start"
    assert "I agree, start" in invited.text
    with lab.database.writing() as db:
        enrol.consent(db, lab, SLUG, prolific("ada"), agree=False, device=DESKTOP)
        enrol.screen_out(db, lab, SLUG, prolific("bob"))
    declined = client.get(f"/s/{SLUG}", params=prolific("ada"))
    assert (declined.status_code, heading(declined.text)) == (200, "You do not take part")
    assert "return your place" in declined.text
    unfit = client.get(f"/s/{SLUG}", params=prolific("bob"))
    assert (unfit.status_code, heading(unfit.text)) == (200, "This study needs another device")
    assert "LOOKED-IN</output>" in unfit.text
    assert verify(lab).clean


def test_no_state_is_left_out_here() -> None:
    assert set(NEXT) == {*STAGES, *ENDS} - {State.DECLINED}


def test_whoever_was_rejected_there_reloads_in_vain_by_every_address(lab: Lab) -> None:
    key = into(lab, State.REJECTED)
    client, before = client_of(lab), person(lab, key)
    for _ in range(3):
        assert heading(client.get(f"/p/{key}").text) == HEADINGS[State.REJECTED]
    back = client.get(f"/s/{SLUG}", params=prolific("ada"))
    assert back.headers["location"] == f"/p/{key}"
    assert client.post(f"/p/{key}/round", json={"after": None}).json() == {"page": f"/p/{key}"}
    assert person(lab, key).status == before.status == "rejected"
    assert person(lab, key).completion_code is None


CODES = {
    State.FINISHED: "FOUND-CHILD",
    State.FAILED: "FOUND-CHILD-2",
    State.SCREENED_OUT: "LOOKED-IN",
    State.WITHDRAWN: "LEFT-EARLY",
}


@pytest.mark.parametrize("state", CODES)
def test_each_end_has_a_code_of_its_own_to_read_and_a_link_that_carries_it(lab: Lab, state: State) -> None:
    text = client_of(lab).get(f"/p/{into(lab, state)}").text
    assert f"{CODES[state]}</output>" in text
    assert f'href="https://app.prolific.com/submissions/complete?cc={CODES[state]}"' in text
    assert not any(
        f">{code}<" in text or f'={code}"' in text for code in set(CODES.values()) - {CODES[state]}
    )
