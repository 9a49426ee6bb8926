"""Who declined, and whom the study could not take: a keyed hash, a status and a date, and nothing else."""

from typing import NamedTuple

from sqlalchemy import delete, func, insert, select

from server.storage.database import DbSession
from server.storage.tables import refusal


class RefusalRow(NamedTuple):
    study_id: int
    external_hash: str
    mode: str
    status: str
    """declined or screened_out."""
    on_date: str


def add(db: DbSession, row: RefusalRow) -> RefusalRow:
    """Keep a refusal; the first one stands, and is what comes back."""
    db.hold()
    if there := of(db, row.study_id, row.external_hash):
        return there
    db.write(insert(refusal), row._asdict())
    return row


def of(db: DbSession, study_id: int, external_hash: str) -> RefusalRow | None:
    statement = select(refusal).where(
        refusal.c.study_id == study_id, refusal.c.external_hash == external_hash
    )
    row = db.read(statement).one_or_none()
    return RefusalRow._make(row) if row else None


def delete_of(db: DbSession, study_id: int, external_hash: str) -> None:
    """Forget that somebody does not take part."""
    db.write(delete(refusal).where(refusal.c.study_id == study_id, refusal.c.external_hash == external_hash))


def counts(db: DbSession, study_id: int, mode: str) -> dict[str, int]:
    """How many, by status."""
    statement = (
        select(refusal.c.status, func.count())
        .where(refusal.c.study_id == study_id, refusal.c.mode == mode)
        .group_by(refusal.c.status)
    )
    rows: list[tuple[str, int]] = [tuple(row) for row in db.read(statement)]
    return dict(rows)
