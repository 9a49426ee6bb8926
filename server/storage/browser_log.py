"""What the browser told of itself while somebody took part: focus, visibility, size, full screen."""

from collections.abc import Sequence
from typing import NamedTuple

from sqlalchemy import func, insert, select

from server.storage.database import DbSession
from server.storage.tables import browser_event


class BrowserEventRow(NamedTuple):
    participant_id: str
    visit: str
    """A name that the page draws when it is loaded; `seq` counts within it."""
    seq: int
    page: str
    kind: str
    value: str
    at_ms: float
    """`performance.now()` of that page."""
    stored_utc: str


def add(db: DbSession, rows: Sequence[BrowserEventRow]) -> int:
    """Store those that are not there yet; how many those were."""
    db.hold()
    if not rows:
        return 0
    first = rows[0]
    key = (browser_event.c.participant_id == first.participant_id) & (browser_event.c.visit == first.visit)
    known = set(db.read(select(browser_event.c.seq).where(key)).scalars())
    fresh = [row._asdict() for row in rows if row.seq not in known]
    if fresh:
        db.write(insert(browser_event), fresh)
    return len(fresh)


def count(db: DbSession, participant_id: str) -> int:
    statement = select(func.count()).where(browser_event.c.participant_id == participant_id)
    return int(db.read(statement).scalar_one())


def of_participant(db: DbSession, participant_id: str) -> list[BrowserEventRow]:
    statement = select(browser_event).where(browser_event.c.participant_id == participant_id)
    ordered = statement.order_by(browser_event.c.stored_utc, browser_event.c.visit, browser_event.c.seq)
    return [BrowserEventRow._make(row) for row in db.read(ordered)]
