"""Who is where in a study, counted in the database. Every count is by mode: people and robots never mix."""

from collections.abc import Mapping
from typing import NamedTuple

from sqlalchemy import Label, case, func, select

from server.storage.database import DbSession
from server.storage.participants import is_away
from server.storage.tables import participant, study_version, trial


class Tally(NamedTuple):
    """People who agree in all of this; `standing`: the stored status, or `away` (active, not seen since)."""

    version: int
    mode: str
    arm: str
    role_order: str
    device: str
    standing: str
    people: int
    last_seen_utc: str


class Stand(NamedTuple):
    """People of one version who agree in mode, arm and standing."""

    mode: str
    arm: str
    standing: str
    people: int


class Person(NamedTuple):
    id: str
    version: int
    arm: str
    role_order: str
    device: str
    browser: str
    page: str
    standing: str
    last_seen_utc: str
    finished_utc: str | None
    rounds_done: int


def standing(leases: Mapping[int, str]) -> Label[str]:
    return case((is_away(leases), "away"), else_=participant.c.status).label("standing")


def tallies(db: DbSession, study_id: int, leases: Mapping[int, str]) -> list[Tally]:
    cell = (
        study_version.c.number,
        participant.c.mode,
        participant.c.arm,
        participant.c.role_order,
        participant.c.device,
        standing(leases),
    )
    statement = (
        select(*cell, func.count(), func.max(participant.c.last_seen_utc))
        .join(study_version, study_version.c.id == participant.c.study_version_id)
        .where(participant.c.study_id == study_id)
        .group_by(*cell)
    )
    return [Tally._make(row) for row in db.read(statement)]


def stands(db: DbSession, study_id: int, leases: Mapping[int, str]) -> list[Stand]:
    """Everybody of a study, whose leases began then, by version."""
    cell = (participant.c.mode, participant.c.arm, standing(leases))
    statement = (
        select(*cell, func.count()).where(participant.c.study_id == study_id).group_by(*cell).order_by(*cell)
    )
    return [Stand._make(row) for row in db.read(statement)]


def people(
    db: DbSession, study_id: int, mode: str, standings: tuple[str, ...], leases: Mapping[int, str], most: int
) -> list[Person]:
    """The last seen first, with the rounds that each has ended (practice included)."""
    where = standing(leases)
    ended = (
        select(func.count())
        .where(trial.c.participant_id == participant.c.id, trial.c.ended_utc.is_not(None))
        .scalar_subquery()
    )
    statement = (
        select(
            participant.c.id,
            study_version.c.number,
            participant.c.arm,
            participant.c.role_order,
            participant.c.device,
            participant.c.browser,
            participant.c.page,
            where,
            participant.c.last_seen_utc,
            participant.c.finished_utc,
            ended,
        )
        .join(study_version, study_version.c.id == participant.c.study_version_id)
        .where(participant.c.study_id == study_id, participant.c.mode == mode)
        .where(where.element.in_(standings))
        .order_by(participant.c.last_seen_utc.desc(), participant.c.id)
        .limit(most)
    )
    return [Person._make(row) for row in db.read(statement)]
