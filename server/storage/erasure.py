"""Deleting what is known of a person: their data, or all of them. How many were erased is counted."""

import secrets
from typing import NamedTuple

from sqlalchemy import ColumnElement, delete, func, select, text, update

from server.storage.database import DbSession
from server.storage.tables import (
    answer,
    browser_event,
    erased,
    identity,
    journey,
    participant,
    payment,
    posting,
    submission,
    trial,
)

DATA = (trial, answer, browser_event)
"""What somebody did; events go with their trials."""
SENT = "sent"
"""State of a payment that is on its way."""
# the same words in SQLite and in PostgreSQL; SQLAlchemy has one insert for each
ONE_MORE = text(
    "INSERT INTO erased (study_id, mode, arm, standing, people) "
    "VALUES (:study_id, :mode, :arm, :standing, 1) "
    "ON CONFLICT (study_id, mode, arm, standing) DO UPDATE SET people = erased.people + 1"
)


class Erased(NamedTuple):
    """People who agree in arm (empty: none was drawn) and standing, and of whom nothing else is known."""

    arm: str
    standing: str
    people: int


def delete_data(db: DbSession, participant_id: str) -> None:
    """Rounds, answers and browser log. Who took part and how it ended stays."""
    for table in DATA:
        db.write(delete(table).where(table.c.participant_id == participant_id))


def delete_person(db: DbSession, participant_id: str) -> None:
    """Everything; of payments only the money stays."""
    delete_data(db, participant_id)
    for request in list(db.read(select(payment.c.request).where(of_person(participant_id))).scalars()):
        nameless = {"request": f"erased-{secrets.token_hex(12)}", "participant_id": "", "submission_id": ""}
        forgotten = update(payment).where(payment.c.request == request)
        db.write(forgotten.values(**nameless, reference="", detail=""))
    db.write(delete(identity).where(identity.c.participant_id == participant_id))
    db.write(delete(participant).where(participant.c.id == participant_id))


def delete_submissions(db: DbSession, study_id: int, external_hash: str) -> None:
    """What a marketplace told of somebody's submissions to a study."""
    db.write(delete(submission).where(of_hash(study_id, external_hash)))


def of_person(participant_id: str) -> ColumnElement[bool]:
    return payment.c.participant_id == participant_id


def of_hash(study_id: int, external_hash: str) -> ColumnElement[bool]:
    mine = select(posting.c.id).where(posting.c.study_id == study_id)
    return (submission.c.external_hash == external_hash) & submission.c.posting_id.in_(mine)


def held(db: DbSession, participant_id: str) -> dict[str, int]:
    """How many rows there are of a person, by what they are."""
    found = {}
    for name, table in {
        "rounds": trial,
        "answers": answer,
        "window events": browser_event,
        "steps of the journey": journey,
    }.items():
        count = select(func.count()).select_from(table).where(table.c.participant_id == participant_id)
        found[name] = int(db.read(count).scalar_one())
    return found


def submissions(db: DbSession, study_id: int, external_hash: str) -> int:
    count = select(func.count()).select_from(submission).where(of_hash(study_id, external_hash))
    return int(db.read(count).scalar_one())


def payments(db: DbSession, participant_id: str) -> list[str]:
    """State of each payment to a person."""
    return list(db.read(select(payment.c.state).where(of_person(participant_id))).scalars())


def count_one(db: DbSession, study_id: int, mode: str, arm: str, standing: str) -> None:
    """Count somebody who was erased."""
    db.write(ONE_MORE, {"study_id": study_id, "mode": mode, "arm": arm, "standing": standing})


def counted(db: DbSession, study_id: int, mode: str) -> list[Erased]:
    """How many were erased."""
    statement = select(erased.c.arm, erased.c.standing, erased.c.people).where(
        erased.c.study_id == study_id, erased.c.mode == mode
    )
    return [Erased._make(row) for row in db.read(statement.order_by(erased.c.arm, erased.c.standing))]
