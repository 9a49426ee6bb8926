"""Rows without the row they belong to. Foreign keys keep them out, unless somebody edits with them off."""

from sqlalchemy import select

from server.storage.database import DbSession
from server.storage.tables import event, participant, trial


def trials(db: DbSession) -> list[str]:
    """Ids of trials whose participant is not there."""
    known = select(participant.c.id).where(participant.c.id == trial.c.participant_id).exists()
    return list(db.read(select(trial.c.id).where(~known).order_by(trial.c.id)).scalars())


def events(db: DbSession) -> list[str]:
    """Ids of the trials that events name and that are not there."""
    known = select(trial.c.id).where(trial.c.id == event.c.trial_id).exists()
    statement = select(event.c.trial_id).where(~known).distinct().order_by(event.c.trial_id)
    return list(db.read(statement).scalars())
