"""Verify: one changed value anywhere makes exactly its trial fail, and the message says where."""

from collections.abc import Iterator
from typing import Any

import pytest
from sqlalchemy import select, update

from server.domain import canonical, events
from server.domain.errors import NotFoundError
from server.services import trial_check
from server.services.lab import Lab
from server.services.session import Session, session_of
from server.services.verify import verify
from server.storage import events as event_rows
from server.storage import participants, trials
from server.storage.database import Database
from server.storage.events import EventRow
from server.storage.tables import allocation, event, participant, study_version, trial
from server.storage.trials import TrialRow
from tests.fakes import fake_bundle, fake_lab
from tests.server.services.steps import come_in, person, play_all, playing
from tests.server.services.test_play import varied

Stored = tuple[Session, TrialRow, list[EventRow]]


def played(lab: Lab) -> None:
    """Two people through both studies."""
    for slug in ("parent-child", "traffic-junction"):
        play_all(lab, playing(lab, slug, "ada", trials_per_block=2), varied)
        play_all(lab, come_in(lab, slug, "bob"), varied)


def stored_trials(lab: Lab) -> list[Stored]:
    with lab.database.reading() as db:
        return [
            (session_of(db, lab, who), row, event_rows.of_trial(db, row.id))
            for who in participants.stream(db)
            for row in trials.of_participant(db, who.id)
        ]


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(value, dict):
        for name in value:
            yield from leaves(value[name], (*path, name))
    elif isinstance(value, list):
        for index in range(len(value)):
            yield from leaves(value[index], (*path, index))
    else:
        yield path


def other(value: Any) -> Any:
    """Another value of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return value + 0.25
    return 0 if value is None else value + "x"


def at(body: Any, path: tuple[Any, ...]) -> Any:
    for step in path:
        body = body[step]
    return body


def changed(row: EventRow, path: tuple[Any, ...]) -> EventRow:
    body = canonical.loads(row.body)
    at(body, path[:-1])[path[-1]] = other(at(body, path))
    return row._replace(body=canonical.dumps(body))


def rechained(row: TrialRow, stored: list[EventRow]) -> tuple[TrialRow, list[EventRow]]:
    """What somebody would leave who changed a value and computed all digests again."""
    digest, again = "", []
    for one in stored:
        digest = events.digest(digest, one.body)
        again.append(one._replace(digest=digest))
    return row._replace(digest=digest), again


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Lab, list[Stored]]]:
    database = Database(f"sqlite:///{tmp_path_factory.mktemp('verify') / 'v.sqlite3'}")
    database.upgrade()
    lab = fake_lab(database)
    played(lab)
    yield lab, stored_trials(lab)
    database.close()


def test_what_was_played_verifies(whole: tuple[Lab, list[Stored]]) -> None:
    lab, stored = whole
    report = verify(lab, audit=True)
    assert report.clean, report.text
    assert (report.participants, report.trials) == (4, len(stored))
    assert "all as stored" in report.text
    assert "audit: 0 of" in report.text
    assert verify(lab, "parent-child").trials == 12


def one_of_each(stored: list[Stored]) -> list[Stored]:
    """A short practice and main trial of every role."""
    kinds: dict[tuple[str, str], Stored] = {}
    for session, row, log in sorted(stored, key=lambda s: len(s[2])):
        if len(log) > 2 or row.role == "child":
            kinds.setdefault((row.role, row.phase), (session, row, log))
    return list(kinds.values())


def test_any_value_of_any_event_changed_alone_is_found(whole: tuple[Lab, list[Stored]]) -> None:
    lab, stored = whole
    tried = 0
    for session, row, log in one_of_each(stored):
        for seq in {0, 1, len(log) - 1}:
            for path in leaves(canonical.loads(log[seq].body)):
                bad = [*log[:seq], changed(log[seq], path), *log[seq + 1 :]]
                found = trial_check.check(lab, session, row, bad)
                assert found, (row.role, row.phase, seq, path)
                assert found.startswith(f"{row.id} ")
                tried += 1
    assert tried > 500


RECORDED = ("timing", "actions", "tokens", "gates", "stored_utc")


def test_what_follows_from_something_else_is_found_even_with_all_digests_computed_again(
    whole: tuple[Lab, list[Stored]],
) -> None:
    lab, stored = whole
    for session, row, log in one_of_each(stored):
        for seq in {0, 1, len(log) - 1}:
            for path in leaves(canonical.loads(log[seq].body)):
                bad = [*log[:seq], changed(log[seq], path), *log[seq + 1 :]]
                new_row, bad = rechained(row, bad)
                found = trial_check.check(lab, session, new_row, bad)
                derived = not set(path) & set(RECORDED) or path[-1] in {"rt_ms", "onset_ms", "response_ms"}
                assert found or not derived, (row.role, row.phase, seq, path)


def test_the_participants_own_action_in_the_world_cannot_differ_from_the_decision(
    whole: tuple[Lab, list[Stored]],
) -> None:
    lab, stored = whole
    for session, row, log in one_of_each(stored):
        if row.role == "child":
            continue
        own = ("moves", 0, "actions", 0 if row.role == "parent" else -1)
        new_row, bad = rechained(row, [log[0], changed(log[1], own), *log[2:]])
        found = str(trial_check.check(lab, session, new_row, bad))
        assert "the decision was" in found or "not one legal action" in found


def test_every_column_of_a_trial_is_compared(whole: tuple[Lab, list[Stored]]) -> None:
    lab, stored = whole
    for session, row, log in one_of_each(stored):
        for name, value in row._asdict().items():
            bad = row._replace(**{name: "x" if value is None else other(value)})
            found = trial_check.check(lab, session, bad, log)
            assert found, name


def test_events_that_are_missing_doubled_or_too_many_are_found(whole: tuple[Lab, list[Stored]]) -> None:
    lab, stored = whole
    session, row, log = max(stored, key=lambda s: len(s[2]))
    assert "seq 3: missing" in str(trial_check.check(lab, session, row, [*log[:3], *log[4:]]))
    assert "trial.last_seq" in str(trial_check.check(lab, session, row, log[:-1]))
    assert "missing" in str(trial_check.check(lab, session, row, [*log, log[-1]]))
    assert "after the end" in str(
        trial_check.check(lab, session, row, [*log, log[-1]._replace(seq=len(log))])
    )
    assert "seq 0: missing" in str(trial_check.check(lab, session, row, []))


def test_the_first_difference_is_named_with_both_values(whole: tuple[Lab, list[Stored]]) -> None:
    lab, stored = whole
    session, row, log = next(s for s in stored if s[1].role == "driver" and s[1].phase == "main")
    body = canonical.loads(log[2].body)
    largest = body["saw"]["triangle_max"]
    body["saw"]["triangle_max"] = 0.31
    bad = [*log[:2], log[2]._replace(body=canonical.dumps(body)), *log[3:]]
    found = trial_check.check(lab, session, row, bad)
    assert found == f"{row.id} seq 2: saw.triangle_max stored 0.31, replay {largest}"


@pytest.mark.parametrize(
    ("path", "says"),
    [
        (("action",), "seq 1"),
        (("token",), "token stored"),
        (("timing", "rt_ms"), "rt_ms"),
        (("timing", "refresh_hz"), "digest"),
        (("saw", "messages_heard"), "saw.messages_heard stored"),
        (("moves", 0, "tokens", 1), "seq 1"),
        (("moves", 0, "actions", 0), "seq 1"),
        (("stored_utc",), "stored_utc"),
    ],
)
def test_one_changed_value_in_the_database_makes_exactly_that_trial_fail(
    lab: Lab, path: tuple[Any, ...], says: str
) -> None:
    play_all(lab, playing(lab, "parent-child", trials_per_block=1), varied)
    victim = next(row.id for _, row, _ in stored_trials(lab) if row.role == "parent" and row.phase == "main")
    with lab.database.writing() as db:
        row = event_rows.one(db, victim, 1)
        assert row is not None
        bad = changed(row, path).body
        db.write(update(event).where(event.c.trial_id == victim, event.c.seq == 1).values(body=bad))
    report = verify(lab)
    assert len(report.differences) == 1, report.text
    assert report.differences[0].startswith(f"{victim} seq 1: ")
    assert says in report.differences[0]
    assert "1 difference" in report.text


def test_a_changed_digest_or_time_of_storing_is_found(lab: Lab) -> None:
    play_all(lab, playing(lab, "traffic-junction", trials_per_block=1), varied)
    ids = [row.id for _, row, _ in stored_trials(lab)]
    with lab.database.writing() as db:
        db.write(update(event).where(event.c.trial_id == ids[0], event.c.seq == 2).values(digest="0" * 64))
        later = "2030-01-01T00:00:00.000Z"
        db.write(update(event).where(event.c.trial_id == ids[1], event.c.seq == 1).values(stored_utc=later))
    assert [line.split()[:3] for line in verify(lab).differences] == [
        [ids[0], "seq", "2:"],
        [ids[1], "seq", "1:"],
    ]


def test_an_arm_a_launched_text_and_a_code_are_checked_too(lab: Lab) -> None:
    key = playing(lab, "traffic-junction", trials_per_block=1)
    who = person(lab, key).id
    with lab.database.writing() as db:
        db.write(update(participant).values(completion_code="FORGED"))
    assert f"{who} has a completion code, but rounds [1, 2]" in verify(lab).text
    with lab.database.writing() as db:
        db.write(update(participant).values(completion_code=None))
        db.write(update(allocation).values(probability=0.5))
    assert "allocation.probability stored 0.5" in verify(lab).text
    with lab.database.writing() as db:
        db.write(update(study_version).values(number=2))
    assert "version 2: is launch number 1" in verify(lab).text
    with lab.database.writing() as db:
        db.write(update(study_version).values(number=1))
        old = db.read(select(study_version.c.definition)).scalar_one()
        db.write(update(study_version).values(definition=old.replace("FORGED", "").replace("60", "61")))
    assert "was changed after its launch" in verify(lab).text


def test_a_trial_of_an_agent_that_was_replaced_says_so(lab: Lab) -> None:
    play_all(lab, playing(lab, "traffic-junction", trials_per_block=1), varied)
    for name in list(lab.bundles):
        lab.bundles[name] = fake_bundle(name, seed=2)  # type: ignore[index]
    report = verify(lab)
    assert len(report.differences) == 1
    assert "is loaded, but not the one with sha256" in report.differences[0]


def test_a_study_that_is_not_there_is_named(lab: Lab) -> None:
    with pytest.raises(NotFoundError, match="nowhere"):
        verify(lab, "nowhere")


def test_a_trial_in_the_middle_verifies_as_far_as_it_goes(lab: Lab) -> None:
    from tests.server.services.steps import decide, open_round

    key = playing(lab, "traffic-junction")
    view = open_round(lab, key)
    assert isinstance(view, dict)
    decide(lab, key, view, 1)
    assert verify(lab, audit=True).clean
    with lab.database.writing() as db:
        db.write(update(trial).values(ended_utc=lab.now_utc()))
    assert "trial.ended_utc" in verify(lab).text
