"""Rows of participants. No marketplace id stands here; see `enrolments`."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from sqlalchemy import ColumnElement, bindparam, case, func, insert, literal, or_, select, update

from server.domain.errors import NotFoundError
from server.storage.database import DbSession
from server.storage.tables import participant


class ParticipantRow(NamedTuple):
    id: str
    study_id: int
    study_version_id: int
    mode: str
    key_sha256: str
    marketplace: str
    arm: str
    role_order: str
    token_permutation: str
    number_permutation: str
    device: str
    browser: str
    viewport: str
    status: str
    page: str
    consented_utc: str
    last_seen_utc: str
    finished_utc: str | None
    completion_code: str | None
    erased_utc: str | None = None


class CellCount(NamedTuple):
    arm: str
    role_order: str
    device: str
    people: int


ROWS_A_PAGE = 500
PARTICIPANT = select(participant)
BY_KEY = PARTICIPANT.where(participant.c.key_sha256 == bindparam("key_sha256"))
SEEN = (
    update(participant)
    .where(participant.c.id == bindparam("participant_id"))
    .values(last_seen_utc=bindparam("now_utc"))
)


def add(db: DbSession, row: ParticipantRow) -> None:
    db.write(insert(participant), row._asdict())


def by_key(db: DbSession, key_sha256: str) -> ParticipantRow | None:
    row = db.read(BY_KEY, {"key_sha256": key_sha256}).one_or_none()
    return ParticipantRow._make(row) if row else None


def by_id(db: DbSession, participant_id: str) -> ParticipantRow:
    return ParticipantRow._make(db.read(PARTICIPANT.where(participant.c.id == participant_id)).one())


def find(db: DbSession, participant_id: str) -> ParticipantRow | None:
    row = db.read(PARTICIPANT.where(participant.c.id == participant_id)).one_or_none()
    return ParticipantRow._make(row) if row else None


def hold(db: DbSession, participant_id: str) -> ParticipantRow:
    """The participant, locked until the transaction ends.

    Raises:
        NotFoundError: the person was erased meanwhile.
    """
    db.hold()
    statement = PARTICIPANT.where(participant.c.id == participant_id).with_for_update()
    row = db.read(statement).one_or_none()
    if row is None:
        raise NotFoundError("there is no such session any more")
    return ParticipantRow._make(row)


def seen(db: DbSession, participant_id: str, now_utc: str) -> None:
    db.write(SEEN, {"participant_id": participant_id, "now_utc": now_utc})


def turn_page(db: DbSession, participant_id: str, page: str, now_utc: str) -> None:
    db.write(
        update(participant).where(participant.c.id == participant_id).values(page=page, last_seen_utc=now_utc)
    )


def end(
    db: DbSession,
    participant_id: str,
    status: str,
    page: str,
    completion_code: str | None,
    finished_utc: str | None,
    now_utc: str,
) -> None:
    """Somebody comes to an end; `finished_utc` only for who went through everything."""
    db.write(
        update(participant)
        .where(participant.c.id == participant_id)
        .values(
            page=page,
            status=status,
            completion_code=completion_code,
            finished_utc=finished_utc,
            last_seen_utc=now_utc,
        )
    )


def resume(db: DbSession, participant_id: str, now_utc: str) -> None:
    """Back into the study, on the page that was left."""
    db.write(
        update(participant)
        .where(participant.c.id == participant_id)
        .values(status="active", completion_code=None, last_seen_utc=now_utc)
    )


def blank(db: DbSession, participant_id: str, now_utc: str) -> None:
    """Forget what the browser told of itself; what was played and answered goes with `erasure`."""
    db.write(
        update(participant)
        .where(participant.c.id == participant_id)
        .values(device="unknown", browser="", viewport="", erased_utc=now_utc)
    )


def is_away(leases: Mapping[int, str]) -> ColumnElement[bool]:
    """Whether somebody who has come to no end was last seen before the lease of their own study version.

    `leases`: when it began, by study version.
    """
    began_utc = case(dict(leases), value=participant.c.study_version_id, else_="") if leases else literal("")
    return (participant.c.status == "active") & (participant.c.last_seen_utc < began_utc)


def holding_places(db: DbSession, study_id: int, mode: str, leases: Mapping[int, str]) -> list[CellCount]:
    """How many people hold a place, by arm, role order and device class: finished, or not away."""
    cell = (participant.c.arm, participant.c.role_order, participant.c.device)
    statement = (
        select(*cell, func.count())
        .where(participant.c.study_id == study_id, participant.c.mode == mode)
        .where(
            or_(
                participant.c.status == "finished",
                (participant.c.status == "active") & ~is_away(leases),
            )
        )
        .group_by(*cell)
        .order_by(*cell)
    )
    return [CellCount._make(row) for row in db.read(statement)]


def stream(db: DbSession, study_id: int | None = None) -> Iterator[ParticipantRow]:
    """Every participant, of one study or of all, by id, with constant memory."""
    after = ""
    while page := next_page(db, study_id, after):
        yield from page
        after = page[-1].id


def next_page(db: DbSession, study_id: int | None, after: str) -> list[ParticipantRow]:
    statement = PARTICIPANT.where(participant.c.id > after).order_by(participant.c.id).limit(ROWS_A_PAGE)
    if study_id is not None:
        statement = statement.where(participant.c.study_id == study_id)
    return [ParticipantRow._make(row) for row in db.read(statement)]
