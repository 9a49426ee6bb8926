"""Rows of trials. What stands after `seed` is computed from the events and kept for quick reading."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

from sqlalchemy import bindparam, func, insert, select, update

from server.storage.database import DbSession
from server.storage.tables import participant, trial


class TrialRow(NamedTuple):
    id: str
    participant_id: str
    round: int
    phase: str
    block: int
    role: str
    number: int
    situation: int
    arm: str
    bundle: str | None
    bundle_sha256: str | None
    seed: int
    last_seq: int
    digest: str
    outcome: str | None
    steps: int
    progress: int
    started_utc: str
    ended_utc: str | None


TRIAL = select(trial)
OF_ROUND = TRIAL.where(
    trial.c.participant_id == bindparam("participant_id"), trial.c.round == bindparam("round")
)
PROGRESS = ("last_seq", "digest", "outcome", "steps", "progress", "ended_utc")
MOVED_ON = (
    update(trial)
    .where(trial.c.id == bindparam("trial_id"))
    .values({name: bindparam(f"new_{name}") for name in PROGRESS})
)


def add(db: DbSession, row: TrialRow) -> None:
    db.write(insert(trial), row._asdict())


def of_round(db: DbSession, participant_id: str, ordinal: int) -> TrialRow | None:
    row = db.read(OF_ROUND, {"participant_id": participant_id, "round": ordinal}).one_or_none()
    return TrialRow._make(row) if row else None


def newest(db: DbSession, participant_id: str) -> TrialRow | None:
    statement = TRIAL.where(trial.c.participant_id == participant_id).order_by(trial.c.round.desc()).limit(1)
    row = db.read(statement).one_or_none()
    return TrialRow._make(row) if row else None


def of_participant(db: DbSession, participant_id: str) -> list[TrialRow]:
    """In the order of their rounds."""
    statement = TRIAL.where(trial.c.participant_id == participant_id).order_by(trial.c.round)
    return [TrialRow._make(row) for row in db.read(statement)]


def of_participants(db: DbSession, participants: Sequence[str]) -> list[TrialRow]:
    """By participant and round."""
    statement = TRIAL.where(trial.c.participant_id.in_(participants)).order_by(
        trial.c.participant_id, trial.c.round
    )
    return [TrialRow._make(row) for row in db.read(statement)]


def moved_on(db: DbSession, row: TrialRow) -> None:
    """Write what the last event changed."""
    new = {f"new_{name}": getattr(row, name) for name in PROGRESS}
    db.write(MOVED_ON, {"trial_id": row.id, **new})


def won(db: DbSession, study_id: int, outcomes: Collection[str]) -> dict[str, int]:
    """How many main rounds each participant of a study has won."""
    statement = (
        select(trial.c.participant_id, func.count())
        .join(participant, participant.c.id == trial.c.participant_id)
        .where(participant.c.study_id == study_id, trial.c.phase == "main", trial.c.outcome.in_(outcomes))
        .group_by(trial.c.participant_id)
    )
    found: dict[str, int] = {}
    for row in db.read(statement):
        who, number = list(row)
        found[who] = int(number)
    return found
