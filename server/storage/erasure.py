"""Deleting what is known of a person: their data, or all of them."""

from sqlalchemy import delete, update

from server.storage.database import DbSession
from server.storage.tables import answer, browser_event, identity, participant, payment, trial

DATA = (trial, answer, browser_event)
"""What somebody did; events go with their trials."""


def delete_data(db: DbSession, participant_id: str) -> None:
    """Rounds, answers and browser log. Who took part and how it ended stays."""
    for table in DATA:
        db.write(delete(table).where(table.c.participant_id == participant_id))


def delete_person(db: DbSession, participant_id: str) -> None:
    """Everything; of payments only the money stays."""
    delete_data(db, participant_id)
    forgotten = update(payment).where(payment.c.participant_id == participant_id)
    db.write(forgotten.values(participant_id="", submission_id="", detail=""))
    db.write(delete(identity).where(identity.c.participant_id == participant_id))
    db.write(delete(participant).where(participant.c.id == participant_id))
