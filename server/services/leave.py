"""Leaving: a person withdraws, and says whether the data may be kept."""

from server.domain.participation import ACTIVE, Event
from server.services import journey
from server.services.journey import PARTICIPANT
from server.services.lab import Lab
from server.services.session import session_of
from server.storage import erasure, participants
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow


def withdraw(db: DbSession, lab: Lab, participant: ParticipantRow, *, keep: bool) -> None:
    """End an active session; without `keep` its rounds, answers and browser log are deleted.

    Whoever has come to an end stays there. The identifier stays until the person is paid (`hatlab erase`).
    """
    participant = participants.hold(db, participant.id)
    if participant.status != ACTIVE:
        return
    journey.happen(db, lab, session_of(db, lab, participant), Event.WITHDRAW, PARTICIPANT)
    if not keep:
        erasure.delete_data(db, participant.id)
        participants.blank(db, participant.id, lab.now_utc())
