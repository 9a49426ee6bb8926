"""Pages turn in order, once, and a code exists only when nothing is missing."""

import pytest
from sqlalchemy import delete, text, update

from server.domain.errors import CorruptError
from server.services import enrol
from server.services.enrol import Page
from server.services.lab import Lab
from server.storage.tables import event, trial
from tests.fakes import definition
from tests.server.services.steps import (
    come_in,
    go_on,
    launch,
    open_round,
    person,
    play_all,
    play_block,
    playing,
)


def page(lab: Lab, key: str) -> Page:
    with lab.database.reading() as db:
        return enrol.page_of(db, lab, enrol.participant_by_key(db, lab, key))


def test_a_session_goes_through_its_pages_in_order(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    key = come_in(lab, "parent-child")
    seen = [page(lab, key)]
    while seen[-1].kind != "end":
        if seen[-1].kind == "play":
            play_block(lab, key)
        else:
            go_on(lab, key)
        seen.append(page(lab, key))
    assert [p.name for p in seen] == ["instructions:1", "play:1", "instructions:2", "play:2", "complete"]
    assert {seen[0].role, seen[2].role} == {"parent", "child"}
    assert [(p.block, p.blocks) for p in seen[:4]] == [(1, 2), (1, 2), (2, 2), (2, 2)]
    assert [p.progress.rounds_over for p in seen] == [0, 0, 3, 3, 6]
    assert seen[-1].progress.rounds == 6
    assert seen[-1].code == "FOUND-CHILD"
    assert all(p.code is None for p in seen[:-1])
    assert seen[0].parameters["PROLIFIC_PID"] == "ada"


def test_going_on_from_a_page_that_was_left_already_changes_nothing(lab: Lab) -> None:
    key = playing(lab, "parent-child")
    with lab.database.writing() as db:
        enrol.advance(db, lab, enrol.participant_by_key(db, lab, key), "instructions:1")
    assert person(lab, key).page == "play:1"


def test_the_board_is_not_left_before_its_rounds_are_played(lab: Lab) -> None:
    key = playing(lab, "parent-child")
    assert go_on(lab, key) == "play:1"
    open_round(lab, key)
    assert go_on(lab, key) == "play:1"


def test_finishing_happens_once(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    play_block(lab, key)
    finished = person(lab, key)
    assert (finished.status, finished.page) == ("finished", "complete")
    assert go_on(lab, key) == "complete"
    open_round(lab, key)
    assert person(lab, key) == finished


LAST = text("(SELECT max(id) FROM trial)")


@pytest.mark.parametrize(
    "damage",
    [
        delete(event).where(event.c.trial_id == LAST, event.c.seq == 2),
        update(event).where(event.c.trial_id == LAST, event.c.seq == 2).values(body="{}"),
        update(trial).where(trial.c.id == LAST).values(digest="0"),
        update(trial).where(trial.c.round == 2).values(outcome=None),
    ],
)
def test_there_is_no_code_while_anything_is_missing(lab: Lab, damage: object) -> None:
    key = playing(lab, "traffic-junction")
    view, after = open_round(lab, key), None
    from tests.server.services.steps import play_round

    for after in (1, 2, 3, 4):
        assert isinstance(view, dict)
        play_round(lab, key, view)
        if after < 4:
            view = open_round(lab, key, after)
    with lab.database.writing() as db:
        db.write(damage)  # type: ignore[arg-type]
    with pytest.raises(CorruptError):
        open_round(lab, key, 4)
    assert person(lab, key).completion_code is None
    assert person(lab, key).page == "play:1"


def test_everything_that_was_played_is_there_at_the_end(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    play_all(lab, key)
    assert page(lab, key).progress.rounds_over == page(lab, key).progress.rounds == 3


def test_nobody_gets_past_an_attention_check_and_is_stuck_without_it(lab: Lab) -> None:
    asked = {"key": "look", "text": "Choose B.", "options": ["A", "B"], "answer": 2, "after": 1}
    key = playing(lab, "traffic-junction", trials_per_block=1, attention=[asked])
    play_block(lab, key)
    assert page(lab, key).kind == "form"
    assert go_on(lab, key) == "play:1"
    assert page(lab, key).kind == "form"
