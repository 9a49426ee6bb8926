"""What happened to each participant, event by event: how the flow of a study is counted and audited."""

from typing import NamedTuple

from sqlalchemy import func, insert, select

from server.storage.database import DbSession
from server.storage.tables import journey


class JourneyRow(NamedTuple):
    participant_id: str
    seq: int
    event: str
    state: str
    """After the event."""
    source: str
    """`participant`, `server`, or the marketplace that told it."""
    stored_utc: str


def add(db: DbSession, participant_id: str, event: str, state: str, source: str, now_utc: str) -> None:
    """Add what happened; the caller holds the participant's row."""
    db.hold()
    number = select(func.coalesce(func.max(journey.c.seq), 0)).where(
        journey.c.participant_id == participant_id
    )
    seq = int(db.read(number).scalar_one()) + 1
    row = JourneyRow(participant_id, seq, event, state, source, now_utc)
    db.write(insert(journey), row._asdict())


def of_participant(db: DbSession, participant_id: str) -> list[JourneyRow]:
    statement = select(journey).where(journey.c.participant_id == participant_id).order_by(journey.c.seq)
    return [JourneyRow._make(row) for row in db.read(statement)]
