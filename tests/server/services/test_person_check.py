"""Verify beyond the trials: a changed, missing or unreadable row about a person is named, and hides none."""

from typing import Any

import pytest
from sqlalchemy import delete, insert, select, text, update

from server.domain import canonical
from server.services.lab import Lab
from server.services.verify import verify
from server.storage.database import Database
from server.storage.tables import allocation, consent, event, identity, participant, trial
from tests.fakes import fake_lab
from tests.server.services.steps import come_in, go_on, open_round, person, play_all, play_round, playing

SLUG = "parent-child"


@pytest.fixture(name="lab")
def lab_with_two(sqlite_database: Database) -> Lab:
    """Ada has finished, Bob is in the middle of his first block."""
    lab = fake_lab(sqlite_database)
    play_all(lab, playing(lab, SLUG, "ada", trials_per_block=1))
    play_some(lab, come_in(lab, SLUG, "bob"))
    assert verify(lab).clean, verify(lab).text
    return lab


def play_some(lab: Lab, key: str) -> None:
    go_on(lab, key)
    view = open_round(lab, key)
    assert isinstance(view, dict)
    play_round(lab, key, view)
    open_round(lab, key, after=view["round"])


def found_after(lab: Lab, *statements: Any) -> list[str]:
    with lab.database.writing() as db:
        for statement in statements:
            db.write(statement)
    return verify(lab).differences


def ada(lab: Lab) -> str:
    with lab.database.reading() as db:
        return str(db.read(select(participant.c.id).where(participant.c.status == "finished")).scalar_one())


@pytest.mark.parametrize(
    ("column", "value", "says"),
    [
        ("completion_code", "OTHER", "completion code stored"),
        ("completion_code", None, "completion code stored"),
        ("status", "active", "status and completion code"),
        ("finished_utc", "2020-01-01T00:00:00.000Z", "finished_utc stored"),
        ("finished_utc", None, "finished_utc stored"),
        ("consented_utc", "2030-01-01T00:00:00.000Z", "consented_utc stored"),
        ("device", "phone", "allocation.cell stored"),
        ("marketplace", "direct", "identity is of another"),
        ("key_sha256", "0", "key_sha256"),
        ("token_permutation", "x", "token_permutation stored x"),
        ("number_permutation", "[1]", "number_permutation stored [1]"),
        ("arm", "nobody", "allocation: stored nobody"),
        ("page", "zzz", "page stored 'zzz'"),
    ],
)
def test_a_changed_column_of_a_participant_is_named(lab: Lab, column: str, value: Any, says: str) -> None:
    who = ada(lab)
    found = found_after(lab, update(participant).where(participant.c.id == who).values({column: value}))
    assert found
    assert all(line.startswith(who) for line in found), found
    assert any(says in line for line in found), found


@pytest.mark.parametrize(
    ("table", "column", "value"),
    [
        (allocation, "seed", 5),
        (allocation, "cell", "[]"),
        (allocation, "counts", "x"),
        (allocation, "probability", 0.123),
        (consent, "text_sha256", "0"),
        (consent, "version", "other"),
        (consent, "choice", "declined"),
        (identity, "external_id", "eve"),
        (identity, "external_hash", "0"),
    ],
)
def test_a_changed_value_beside_a_participant_is_named(lab: Lab, table: Any, column: str, value: Any) -> None:
    who = ada(lab)
    found = found_after(lab, update(table).where(table.c.participant_id == who).values({column: value}))
    assert found
    assert all(line.startswith(who) for line in found), found
    assert "eve" not in " ".join(found)


@pytest.mark.parametrize("table", [allocation, consent, identity])
def test_a_row_that_is_missing_beside_a_participant_stops_nothing_else(lab: Lab, table: Any) -> None:
    who = ada(lab)
    found = found_after(
        lab,
        delete(table).where(table.c.participant_id == who),
        update(event).where(event.c.trial_id.not_like(f"{who}%"), event.c.seq == 1).values(digest="0"),
    )
    assert sum(line.startswith(f"{who} cannot be checked") for line in found) == 1
    assert len(found) == 2, found


@pytest.mark.parametrize("body", ["", "[]", "NaN", '{"kind":"start"}', "[" * 100_000])
def test_an_event_that_cannot_be_read_makes_exactly_its_trial_fail(lab: Lab, body: str) -> None:
    victim = f"{ada(lab)}-002"
    found = found_after(
        lab, update(event).where(event.c.trial_id == victim, event.c.seq == 0).values(body=body)
    )
    assert [line.split()[0] for line in found] == [victim]


def whose(lab: Lab, name: str) -> str:
    """A trial that was followed by another: a finished person's, or one in the middle of a block."""
    who = ada(lab)
    if name == "ada":
        return f"{who}-002"
    with lab.database.reading() as db:
        other = db.read(select(participant.c.id).where(participant.c.id != who)).scalar_one()
    return f"{other}-001"


@pytest.mark.parametrize("name", ["ada", "bob"])
def test_a_whole_trial_that_is_gone_is_named(lab: Lab, name: str) -> None:
    victim = whose(lab, name)
    found = found_after(
        lab, delete(event).where(event.c.trial_id == victim), delete(trial).where(trial.c.id == victim)
    )
    assert [line.split()[0] for line in found] == [victim]
    assert "missing" in found[0]


def test_a_last_event_taken_away_together_with_its_traces_is_named(lab: Lab) -> None:
    victim = whose(lab, "bob")
    with lab.database.reading() as db:
        last, before = db.read(
            select(event.c.seq, event.c.digest).where(event.c.trial_id == victim).order_by(event.c.seq.desc())
        ).all()[:2]
    shorter = {"last_seq": before.seq, "digest": before.digest, "outcome": None, "ended_utc": None}
    with lab.database.reading() as db:
        steps = db.read(select(trial.c.steps).where(trial.c.id == victim)).scalar_one()
    found = found_after(
        lab,
        delete(event).where(event.c.trial_id == victim, event.c.seq == last.seq),
        update(trial).where(trial.c.id == victim).values(**shorter, steps=steps - 1),
    )
    assert [line.split()[0] for line in found] == [victim]


@pytest.mark.parametrize(
    ("statement", "says"),
    [
        ("DELETE FROM participant WHERE id = :who", "is a trial of nobody"),
        ("DELETE FROM trial WHERE participant_id = :who", "has events, but is no trial"),
    ],
)
def test_rows_that_belong_to_nobody_are_named(lab: Lab, statement: str, says: str) -> None:
    with lab.database.engine.connect() as connection:
        connection.exec_driver_sql("PRAGMA foreign_keys=OFF")
        connection.execute(text(statement), {"who": ada(lab)})
        connection.commit()
        connection.exec_driver_sql("PRAGMA foreign_keys=ON")
    assert says in verify(lab).text


def test_signs_and_the_log_changed_together_do_not_fit_the_draw(lab: Lab) -> None:
    """Whoever rewrites permutation, spec and digests alike would need the secret key's seed."""
    who = ada(lab)
    with lab.database.reading() as db:
        row = db.read(select(participant.c.number_permutation).where(participant.c.id == who)).scalar_one()
    turned = canonical.dumps([*canonical.loads(row)[1:], canonical.loads(row)[0]])
    found = found_after(
        lab, update(participant).where(participant.c.id == who).values(number_permutation=turned)
    )
    assert any(line.startswith(f"{who} number_permutation stored") for line in found), found


def test_an_unfinished_person_without_rounds_is_in_order(sqlite_database: Database) -> None:
    lab = fake_lab(sqlite_database)
    key = playing(lab, SLUG)
    assert person(lab, key).page == "play:1"
    assert verify(lab).clean


def test_a_test_that_is_made_live_afterwards_is_found(lab: Lab) -> None:
    """Robots and tests become data by one changed word; the start of every trial says what it was."""
    who = ada(lab)
    found = found_after(lab, update(participant).where(participant.c.id == who).values(mode="robot"))
    assert found
    assert all(line.startswith(who) and "mode stored live" in line for line in found), found


def test_a_trial_passed_off_as_somebody_elses_is_found(sqlite_database: Database) -> None:
    """Two drivers of one arm who met the same situation: nothing but the log's own name tells them apart."""
    lab = fake_lab(sqlite_database)
    arms = [{"name": "one", "bundle": "traffic_junction/budget-100", "places": 9}]
    play_all(lab, playing(lab, "traffic-junction", "ada", trials_per_block=1, arms=arms))
    play_all(lab, come_in(lab, "traffic-junction", "bob"))
    with lab.database.reading() as db:
        first, second = sorted(db.read(select(trial.c.id).where(trial.c.phase == "main")).scalars())
        rows = {
            name: db.read(select(event).where(event.c.trial_id == name).order_by(event.c.seq))
            .mappings()
            .all()
            for name in (first, second)
        }
        row = db.read(select(trial).where(trial.c.id == second)).mappings().one()
    kept = ("last_seq", "digest", "outcome", "steps", "progress", "started_utc", "ended_utc")
    with lab.database.writing() as db:
        db.write(delete(event).where(event.c.trial_id == first))
        db.write(insert(event), [{**one, "trial_id": first} for one in rows[second]])
        db.write(update(trial).where(trial.c.id == first).values({name: row[name] for name in kept}))
    found = verify(lab).differences
    # where the later trial went to the earlier person, their own times contradict it too
    assert all(line.startswith(first.rpartition("-")[0]) for line in found), found
    assert found[0].startswith(f"{first} seq 0: trial stored {second}")
