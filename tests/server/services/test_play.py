"""Steps: idempotent, safe against other writers, the same from memory and from the log."""

import shutil
import threading
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy.event import listen, remove

from server.domain import canonical
from server.domain.errors import BadInputError, NotFoundError, StaleError
from server.domain.view import View
from server.services import play
from server.services.lab import Lab
from server.services.play import PageChange
from server.services.recent import Recent
from server.services.session import session_of
from server.services.verify import verify
from server.storage import events, trials
from server.storage.database import Database
from tests.fakes import FakeClock, another_worker, fake_lab, hasty, timing
from tests.server.services.steps import (
    come_in,
    decide,
    first,
    go_on,
    open_round,
    person,
    play_all,
    play_block,
    play_round,
    playing,
)

STUDIES = ["parent-child", "traffic-junction"]


def begun(lab: Lab, key: str, after: int | None = None) -> View:
    view = open_round(lab, key, after)
    assert not isinstance(view, PageChange)
    return view


def text(view: Any) -> str:
    return canonical.dumps(view)


def varied(view: View) -> int:
    """A play style with all kinds of ends."""
    actions = view["actions"]
    if view["role"] == "driver":
        return int(view["triangles"] != [] and view["step"] % 3 == 0)
    return int(actions[(view["step"] * 7 + view["round"]) % len(actions)])


@pytest.mark.parametrize("slug", STUDIES)
def test_a_whole_session_is_played_and_verifies(lab: Lab, slug: str) -> None:
    key = playing(lab, slug)
    play_block(lab, key, varied)
    play_all(lab, key, varied)
    finished = person(lab, key)
    assert finished.status == "finished"
    assert finished.completion_code
    report = verify(lab, audit=True)
    assert report.clean, report.text
    assert report.trials == {"parent-child": 8, "traffic-junction": 4}[slug]
    assert report.audit is not None
    assert (report.audit.otherwise, report.audit.decided > 100) == (0, True)


class AlikeLab(Lab):
    """Everybody who enrols draws the same, so that sessions can be compared."""

    def seed(self, participant_id: str) -> int:
        return 20261124


def workers_of(path: Path, caches: tuple[int, ...]) -> list[Lab]:
    made = fake_lab(hasty(Database(f"sqlite:///{path}")))
    lab = AlikeLab(**{field.name: getattr(made, field.name) for field in fields(made)})
    return [another_worker(lab, cache=cache) for cache in caches]


def answers(workers: list[Lab], slug: str) -> list[str]:
    """Everything that a participant is shown when the workers answer in turn."""
    turn, shown = cycle(workers), []
    key = playing(workers[0], slug)
    while (page := person(next(turn), key).page) != "complete":
        after = None
        while page.startswith("play") and not isinstance(
            view := open_round(next(turn), key, after), PageChange
        ):
            shown.append(text(view))
            while view["over"] is None:
                view = decide(next(turn), key, view, varied(view))
                shown.append(text(view))
            after = view["round"]
        go_on(next(turn), key)
    return shown


@pytest.mark.parametrize("slug", STUDIES)
def test_the_cache_changes_no_byte_and_two_workers_may_take_turns(
    migrated_sqlite: Path, tmp_path: Path, slug: str
) -> None:
    shown = []
    for caches in ((64,), (0,), (1,), (64, 64), (64, 0, 2)):
        path = tmp_path / f"{len(shown)}.sqlite3"
        shutil.copy(migrated_sqlite, path)
        shown.append(answers(workers_of(path, caches), slug))
    assert len(shown[0]) > 30
    assert shown[1:] == [shown[0]] * 4


@pytest.mark.parametrize("slug", STUDIES)
def test_a_step_sent_again_gets_the_same_answer_again(lab: Lab, slug: str) -> None:
    key = playing(lab, slug)
    view = begun(lab, key)
    while view["over"] is None:
        action = varied(view)
        answer = decide(lab, key, view, action)
        for worker in (lab, another_worker(lab, cache=0)):
            assert text(decide(worker, key, view, action)) == text(answer)
        view = answer
    with lab.database.reading() as db:
        row = trials.newest(db, person(lab, key).id)
        assert row is not None
        assert len(events.of_trial(db, row.id)) == view["seq"] + 1


def test_an_early_step_sent_again_late_gets_its_own_answer(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    view = begun(lab, key)
    answers = [(view, decide(lab, key, view, 0))]
    answers.append((answers[0][1], decide(lab, key, answers[0][1], 1)))
    decide(lab, key, answers[1][1], 0)
    for before, answer in answers:
        action = 0 if before is view else 1
        assert text(decide(lab, key, before, action)) == text(answer)


def stale(lab: Lab, key: str, view: View, action: int, **changes: Any) -> View:
    with pytest.raises(StaleError) as caught:
        decide(lab, key, view, action, **changes)
    assert caught.value.status == 409
    return dict(caught.value.view)


def test_another_answer_to_a_step_is_told_the_current_view(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    view = begun(lab, key)
    now = decide(lab, key, view, 0)
    assert text(stale(lab, key, view, 1)) == text(now)
    assert text(stale(lab, key, view, 0, early_keys=1)) == text(now)
    further = decide(lab, key, now, 0)
    assert text(stale(lab, key, view, 1)) == text(further)


def test_a_step_from_the_future_or_before_the_first_is_told_the_current_view(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    view = begun(lab, key)
    expected = {name: value for name, value in view.items() if name != "roads"}
    for seq in (1, 7, -1, -2):
        assert stale(lab, key, {**view, "seq": view["seq"] + seq}, 0) == expected


def test_a_round_that_is_over_takes_no_further_step(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    end = play_round(lab, key, begun(lab, key))
    assert text(stale(lab, key, end, 0)) == text(end)


@pytest.mark.parametrize("slug", STUDIES)
def test_what_is_not_on_offer_is_refused_and_stored_nowhere(lab: Lab, slug: str) -> None:
    key = playing(lab, slug)
    view = begun(lab, key)
    for action in (-1, 99, 10):
        with pytest.raises(BadInputError, match="action"):
            decide(lab, key, view, action)
    with pytest.raises(BadInputError, match="rt_ms"), lab.database.writing() as db:
        play.decide(db, lab, person(lab, key), 1, 1, first(view), {**timing(), "rt_ms": 1.0})
    assert begun(lab, key)["seq"] == 0


def test_a_round_that_was_not_opened_is_not_found(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    view = begun(lab, key)
    with pytest.raises(NotFoundError):
        decide(lab, key, {**view, "round": 2}, 0)


def at_once(*calls: Callable[[], Any]) -> list[Any]:
    """Run in threads that start together; results, or the errors raised."""
    barrier, results = threading.Barrier(len(calls)), [None] * len(calls)

    def run(index: int) -> None:
        barrier.wait()
        try:
            results[index] = calls[index]()
        except (StaleError, AssertionError) as error:
            results[index] = error

    threads = [threading.Thread(target=run, args=(index,)) for index in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return results


def test_of_two_writers_of_a_step_one_wins_and_the_other_is_told_to_read_again(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    view = begun(lab, key)
    workers = [lab, another_worker(lab), another_worker(lab, cache=0), another_worker(lab)]
    for _ in range(6):
        results = at_once(*(partial(decide, w, key, view, n % 2) for n, w in enumerate(workers)))
        won = [r for r in results if isinstance(r, dict)]
        lost = [r for r in results if isinstance(r, StaleError)]
        assert (len(won), len(lost)) == (2, 2), results
        assert text(won[0]) == text(won[1]) == text(dict(lost[0].view)) == text(dict(lost[1].view))
        view = won[0]
        if view["over"]:
            break
    assert verify(lab).clean


def test_a_round_opened_in_two_tabs_at_once_is_one_round(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    workers = [lab, another_worker(lab), another_worker(lab, cache=0)]
    results = at_once(*(lambda w=w: text(open_round(w, key)) for w in workers))
    assert len(set(results)) == 1
    with lab.database.reading() as db:
        assert len(trials.of_participant(db, person(lab, key).id)) == 1


def test_a_reload_goes_on_at_the_same_step(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    view = decide(lab, key, begun(lab, key), 0)
    again = begun(another_worker(lab, cache=0), key)
    assert {name: value for name, value in again.items() if name != "roads"} == view
    assert again["roads"] == {"rows": [6, 7], "columns": [6, 7]}


def test_a_reload_after_the_end_of_a_round_shows_that_end_again(lab: Lab) -> None:
    key = playing(lab, "parent-child")
    end = play_round(lab, key, begun(lab, key))
    again = begun(lab, key)
    assert {name: value for name, value in again.items() if name != "roads"} == end
    assert begun(lab, key, after=end["round"])["round"] == 2


def test_asking_twice_for_the_next_round_opens_it_once(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    end = play_round(lab, key, begun(lab, key))
    assert text(begun(lab, key, after=1)) == text(begun(lab, key, after=1))
    assert text(begun(lab, key, after=end["round"])) == text(begun(lab, key))


def test_the_next_round_does_not_open_before_the_present_one_has_ended(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    view = begun(lab, key)
    assert begun(lab, key, after=1)["round"] == view["round"]
    assert begun(lab, key, after=99)["round"] == view["round"]


def test_rounds_are_played_on_the_page_of_their_block_only(lab: Lab) -> None:
    key = playing(lab, "parent-child")
    play_block(lab, key)
    assert person(lab, key).page == "instructions:2"
    assert isinstance(open_round(lab, key), PageChange)
    assert isinstance(open_round(lab, key, after=4), PageChange)


def test_nothing_is_shown_that_is_not_stored(sqlite_database: Database) -> None:
    """When the answer leaves `writing()`, another connection reads the event that it shows."""
    lab = fake_lab(sqlite_database)
    key = playing(lab, "traffic-junction")
    view = begun(lab, key)
    while view["over"] is None:
        view = decide(lab, key, view, varied(view))
        with Database(str(sqlite_database.url)).reading() as db:
            row = trials.newest(db, person(lab, key).id)
            assert row is not None
            stored = canonical.loads(events.of_trial(db, row.id)[-1].body)
        assert row.last_seq == view["seq"]
        assert [stored["saw"]["row"], stored["saw"]["col"]] == view["cell"]
        largest = max((t[2] for t in view["triangles"]), default=0)
        assert stored["saw"]["triangle_max"] == largest


def test_practice_is_the_same_in_every_arm(lab: Lab) -> None:
    keys = [playing(lab, "traffic-junction", "p0")]
    arms = {person(lab, keys[0]).arm}
    while len(arms) < 3:
        keys.append(come_in(lab, "traffic-junction", f"p{len(keys)}"))
        go_on(lab, keys[-1])
        arms.add(person(lab, keys[-1]).arm)
    views = [play_round(lab, key, begun(lab, key)) for key in keys]
    assert len({text(view) for view in views}) == 1
    assert views[0]["phase"] == "practice"
    assert views[0]["over"]["outcome"] == "arrived"


def test_blank_signs_in_practice_and_numbers_after_it(lab: Lab) -> None:
    key = playing(lab, "parent-child")
    practice = begun(lab, key)
    assert practice["blank"]
    play_round(lab, key, practice)
    assert not begun(lab, key, after=1)["blank"]


def test_seen_is_kept_without_a_write_for_every_step(sqlite_database: Database) -> None:
    lab = fake_lab(sqlite_database, clock=FakeClock(step_s=8))
    key = playing(lab, "traffic-junction")
    view, seen = begun(lab, key), set()
    for _ in range(8):
        view = decide(lab, key, view, 1)
        seen.add(person(lab, key).last_seen_utc)
    assert 2 <= len(seen) <= 6


def test_a_token_that_a_person_chose_reaches_the_parent_and_the_log(lab: Lab) -> None:
    key = playing(lab, "parent-child", arms=one_arm("one-hot"))
    ends = [play_block(lab, key, varied)]
    go_on(lab, key)
    ends.append(play_block(lab, key, varied))
    participant = person(lab, key)
    places = canonical.loads(participant.token_permutation)
    numbers = canonical.loads(participant.number_permutation)
    with lab.database.reading() as db:
        session = session_of(db, lab, participant)
        for row in trials.of_participant(db, participant.id):
            if row.role == "child" and row.phase == "main":
                body = canonical.loads(events.of_trial(db, row.id)[1].body)
                assert numbers[places[body["token"]]] == body["action"]
                assert all(m["tokens"][1] in {body["token"], -1} for m in body["moves"])
    assert session.arm.name == "one-hot"
    assert places != list(range(9))


def one_arm(name: str) -> list[dict[str, Any]]:
    from tests.fakes import definition

    study = definition("parent-child")
    return [study.arm(name).model_dump()]


def test_a_trial_takes_one_place_in_the_cache_however_long_it_is(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    view = begun(lab, key)
    for _ in range(4):
        view = decide(lab, key, view, 1)
    held = [name for name in lab.cache._values if name[0].endswith("-001")]
    assert len(held) == 1


def test_the_cache_keeps_what_was_used_last() -> None:
    recent = Recent(2)
    recent.put("a", 1)
    recent.put("b", 2)
    assert recent.get("a") == 1
    recent.put("c", 3)
    assert (recent.get("a"), recent.get("b"), recent.get("c")) == (1, None, 3)
    nothing = Recent(0)
    nothing.put("a", 1)
    assert nothing.get("a") is None


def statements(lab: Lab, work: Callable[[], object]) -> int:
    """How many statements the database is sent meanwhile."""
    sent: list[str] = []

    def note(*of_cursor: Any) -> None:
        sent.append(of_cursor[2])

    listen(lab.database.engine, "before_cursor_execute", note)
    try:
        work()
    finally:
        remove(lab.database.engine, "before_cursor_execute", note)
    return len(sent)


def test_a_step_costs_four_statements_and_a_new_round_seven(sqlite_database: Database) -> None:
    lab = fake_lab(sqlite_database)
    key = playing(lab, "traffic-junction", trials_per_block=3)
    ended = play_round(lab, key, begun(lab, key))["round"]
    assert statements(lab, lambda: open_round(lab, key, ended)) == 7
    view = begun(lab, key)
    assert statements(lab, lambda: decide(lab, key, view, first(view))) == 4
