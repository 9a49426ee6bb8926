"""Rows of events: append-only, numbered without gaps.

The primary key (trial_id, seq) is the lock of a step.
"""

from typing import NamedTuple

from sqlalchemy import bindparam, select, text
from sqlalchemy.exc import IntegrityError

from server.domain.errors import ClosedError
from server.storage.database import DbSession
from server.storage.tables import event


class EventRow(NamedTuple):
    trial_id: str
    seq: int
    body: str
    digest: str
    stored_utc: str


EVENT = select(event)
OF_TRIAL = EVENT.where(
    event.c.trial_id == bindparam("trial_id"), event.c.seq <= bindparam("seq_max")
).order_by(event.c.seq)
ONE = EVENT.where(event.c.trial_id == bindparam("trial_id"), event.c.seq == bindparam("seq"))
# the same words in SQLite and in PostgreSQL; SQLAlchemy has one insert for each
APPEND = text(
    "INSERT INTO event (trial_id, seq, body, digest, stored_utc) "
    "VALUES (:trial_id, :seq, :body, :digest, :stored_utc) ON CONFLICT DO NOTHING"
)
SEQ_MAX = 2**31 - 1


def append(db: DbSession, row: EventRow) -> bool:
    """Store the event; False if another writer has stored this step of the trial before.

    Raises:
        ClosedError: the trial was deleted meanwhile: its person left without leaving data.
    """
    try:
        return db.write(APPEND, row._asdict()).rowcount == 1
    except IntegrityError as error:
        raise ClosedError("this session is over; load its page again to see what to do") from error


def of_trial(db: DbSession, trial_id: str, seq_max: int = SEQ_MAX) -> list[EventRow]:
    """In order, up to and with `seq_max`."""
    rows = db.read(OF_TRIAL, {"trial_id": trial_id, "seq_max": seq_max})
    return [EventRow._make(row) for row in rows]


def one(db: DbSession, trial_id: str, seq: int) -> EventRow | None:
    row = db.read(ONE, {"trial_id": trial_id, "seq": seq}).one_or_none()
    return EventRow._make(row) if row else None
