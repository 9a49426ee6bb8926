"""Forms: what must be answered, two tries of a quiz, attention checks, and two tabs with the same form."""

import threading

import pytest

from server.services import enrol
from server.services.answer import FormError
from server.services.lab import Lab
from server.services.play import PageChange
from server.services.verify import verify
from server.storage import answers, journeys
from server.storage.answers import AnswerRow
from tests.server.services.steps import go_on, open_round, person, play_round
from tests.server.services.walks import (
    TIMED,
    asked,
    at_end,
    careless,
    entered,
    hand_in,
    on,
    page,
    right,
    walk_to,
    wrong,
)

SLUG = "traffic-junction"
OPEN_QUESTION = [
    {
        "key": "about",
        "title": "About",
        "items": [
            {"key": "age", "text": "How old?", "kind": "number", "minimum": 18, "maximum": 99},
            {"key": "hard", "text": "How hard?", "kind": "scale"},
            {"key": "words", "text": "In words?", "kind": "text", "required": False},
        ],
    }
]


def stored(lab: Lab, key: str) -> list[AnswerRow]:
    with lab.database.reading() as db:
        return answers.of_participant(db, enrol.participant_by_key(db, lab, key).id)


def events(lab: Lab, key: str) -> list[str]:
    with lab.database.reading() as db:
        return [row.event for row in journeys.of_participant(db, person(lab, key).id)]


@pytest.mark.parametrize(
    ("given", "wrong_ones"),
    [
        ({}, {"age", "hard"}),
        ({"age": "17", "hard": "5"}, {"age"}),
        ({"age": "old", "hard": "3"}, {"age", "hard"}),
        ({"age": "30", "hard": " ", "words": "x" * 4_001}, {"hard", "words"}),
    ],
)
def test_a_form_with_a_wrong_answer_is_not_stored_and_each_one_has_a_message(
    lab: Lab, given: dict[str, str], wrong_ones: set[str]
) -> None:
    key = entered(lab, SLUG, questionnaires=OPEN_QUESTION)
    walk_to(lab, key, asked("questionnaire"))
    before = stored(lab, key)
    with pytest.raises(FormError) as caught:
        hand_in(lab, key, given)
    assert set(caught.value.fields) == wrong_ones
    assert all(caught.value.fields.values())
    assert stored(lab, key) == before
    assert page(lab, key).name == "survey:0"


def test_what_is_optional_may_stay_empty_and_what_nobody_asked_is_not_kept(lab: Lab) -> None:
    key = entered(lab, SLUG, questionnaires=OPEN_QUESTION)
    walk_to(lab, key, asked("questionnaire"))
    hand_in(lab, key, {"age": "30", "hard": "55", "surprise": "x"}, timing=TIMED)
    rows = {row.item: row for row in stored(lab, key) if row.form == "about:0"}
    assert {item: row.value for item, row in rows.items()} == {"age": "30", "hard": "55", "words": ""}
    assert (rows["age"].first_ms, rows["age"].last_ms, rows["age"].changes) == (812.25, 1_604.5, 2)
    assert rows["words"].first_ms is None
    assert page(lab, key).state == "finished"


def test_the_quiz_may_be_tried_twice_and_the_second_time_counts(lab: Lab) -> None:
    key = entered(lab, SLUG)
    shown = walk_to(lab, key, asked("quiz"))
    assert (shown.form.attempt, shown.form.tries_left) == (1, 1)  # type: ignore[union-attr]
    hand_in(lab, key, wrong(shown))
    again = page(lab, key)
    assert (again.state, again.form.attempt, again.form.tries_left) == ("practised", 2, 0)  # type: ignore[union-attr]
    hand_in(lab, key, right(again))
    assert page(lab, key).name == "play:1"
    tries = {(row.attempt, row.item): row.correct for row in stored(lab, key)}
    assert [correct for (attempt, _), correct in tries.items() if attempt == 2] == [True] * 4
    assert [correct for (attempt, _), correct in tries.items() if attempt == 1].count(False) == 1
    assert verify(lab).clean


def test_whoever_fails_the_quiz_twice_is_screened_out_with_a_code_and_never_rejected(lab: Lab) -> None:
    key = entered(lab, SLUG)
    walk_to(lab, key, asked("quiz"))
    for _ in range(2):
        hand_in(lab, key, wrong(page(lab, key)))
    shown = page(lab, key)
    assert (shown.kind, shown.state, shown.code) == ("end", "screened_out", "LOOKED-IN")
    assert "rejected" not in {person(lab, key).status, *events(lab, key)}
    assert events(lab, key)[-1] == "quiz_failed"
    assert person(lab, key).finished_utc is None
    before = stored(lab, key)
    hand_in(lab, key, {}, name="quiz:1", attempt=2)
    assert go_on(lab, key) == "quiz:1"
    assert isinstance(open_round(lab, key), PageChange)
    assert stored(lab, key) == before
    assert verify(lab).clean


def test_a_form_handed_in_by_two_tabs_is_one_try(lab: Lab) -> None:
    key = entered(lab, SLUG)
    in_both = walk_to(lab, key, asked("quiz"))
    hand_in(lab, key, wrong(in_both), attempt=1)
    hand_in(lab, key, wrong(in_both), attempt=1)
    assert page(lab, key).state == "practised"
    assert {row.attempt for row in stored(lab, key)} == {1}
    hand_in(lab, key, right(in_both), attempt=2)
    hand_in(lab, key, wrong(in_both), attempt=2)
    assert page(lab, key).name == "play:1"


def test_two_tabs_that_hand_in_at_the_same_moment_are_one_try(lab: Lab) -> None:
    key = entered(lab, SLUG)
    given = wrong(walk_to(lab, key, asked("quiz")))
    threads = [
        threading.Thread(target=hand_in, args=(lab, key, given), kwargs={"name": "quiz:1", "attempt": 1})
        for _ in range(5)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    rows = stored(lab, key)
    assert len(rows) == len(given)
    assert {row.attempt for row in rows} == {1}
    assert page(lab, key).state == "practised"


@pytest.mark.parametrize(("name", "attempt"), [("tlx:1", 1), ("quiz:2", 1), ("quiz:1", 3), ("nothing", 1)])
def test_a_form_that_is_not_due_changes_nothing(lab: Lab, name: str, attempt: int) -> None:
    key = entered(lab, SLUG)
    shown = walk_to(lab, key, asked("quiz"))
    hand_in(lab, key, right(shown), name=name, attempt=attempt)
    assert stored(lab, key) == []
    assert page(lab, key).state == "practised"


def test_an_attention_check_comes_after_its_round_and_no_round_before_it_is_answered(lab: Lab) -> None:
    key = entered(lab, SLUG, trials_per_block=3)
    walk_to(lab, key, on("play"))
    view = open_round(lab, key)
    assert isinstance(view, dict)
    play_round(lab, key, view)
    shown = page(lab, key)
    assert shown.form is not None
    assert (shown.form.name, shown.name) == ("attention:1", "play:1")
    assert isinstance(open_round(lab, key, view["round"]), PageChange)
    hand_in(lab, key, right(shown))
    assert page(lab, key).form is None
    assert isinstance(open_round(lab, key, view["round"]), dict)


def test_whoever_fails_one_check_finishes_and_whoever_fails_two_is_thanked_and_excluded(lab: Lab) -> None:
    once, twice = entered(lab, SLUG), ""
    failed = []

    def one(shown):  # type: ignore[no-untyped-def]
        if shown.form.kind == "attention" and not failed:
            failed.append(shown.form.name)
            return wrong(shown)
        return right(shown)

    assert walk_to(lab, once, at_end, one).state == "finished"
    with lab.database.writing() as db:
        done = enrol.consent(
            db,
            lab,
            SLUG,
            {"PROLIFIC_PID": "bob", "SESSION_ID": "s2"},
            agree=True,
            device=enrol.DeviceReport("desktop"),
        )
    assert isinstance(done, enrol.Enrolled)
    twice = done.key
    end = walk_to(lab, twice, at_end, careless)
    assert (end.state, end.code) == ("failed", "CROSSED-OVER-2")
    assert page(lab, once).code == "CROSSED-OVER"
    assert end.progress.rounds_over == end.progress.rounds
    assert person(lab, twice).finished_utc
    assert events(lab, twice)[-1] == "all_answered_inattentive"
    assert verify(lab).clean


def test_marks_are_cells_of_the_board_and_may_be_left_out(lab: Lab) -> None:
    key = entered(lab, "parent-child")
    shown = walk_to(lab, key, asked("probe"))
    for bad in ("9,0", "0,9", "-1,0", "4", "4,4,4", "a,b"):
        with pytest.raises(FormError) as caught:
            hand_in(lab, key, {"sign_3": bad})
        assert set(caught.value.fields) == {"sign_3"}
    hand_in(lab, key, {"sign_3": "0,8"})
    marks = {row.item: row.value for row in stored(lab, key) if row.form == "probe:0"}
    assert len(marks) == len(shown.form.items) == 9  # type: ignore[union-attr]
    assert {item: value for item, value in marks.items() if value} == {"sign_3": "0,8"}
    assert page(lab, key).name == "survey:0"
