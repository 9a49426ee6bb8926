"""Rows written once, when consent ends.

Who the marketplace says it is, what was agreed to, how the arm was drawn.
"""

from typing import NamedTuple

from sqlalchemy import insert, select, update

from server.storage.database import DbSession
from server.storage.tables import allocation, consent, identity


class IdentityRow(NamedTuple):
    participant_id: str
    study_id: int
    marketplace: str
    external_id: str
    external_hash: str
    submission_id: str | None
    parameters: str


class ConsentRow(NamedTuple):
    participant_id: str
    text_sha256: str
    version: str
    choice: str
    consented_utc: str


class AllocationRow(NamedTuple):
    participant_id: str
    counts: str
    cell: str
    probability: float
    seed: int
    allocated_utc: str


def add(db: DbSession, who: IdentityRow, agreed: ConsentRow, drawn: AllocationRow) -> None:
    db.write(insert(identity), who._asdict())
    db.write(insert(consent), agreed._asdict())
    db.write(insert(allocation), drawn._asdict())


def participant_of(db: DbSession, study_id: int, marketplace: str, external_hash: str) -> str | None:
    """The id of the person who came before under this name, if any."""
    return db.read(
        select(identity.c.participant_id).where(
            identity.c.study_id == study_id,
            identity.c.marketplace == marketplace,
            identity.c.external_hash == external_hash,
        )
    ).scalar_one_or_none()


def identity_of(db: DbSession, participant_id: str) -> IdentityRow:
    return IdentityRow._make(
        db.read(select(identity).where(identity.c.participant_id == participant_id)).one()
    )


def renew(db: DbSession, participant_id: str, submission_id: str, parameters: str) -> None:
    """Another sitting of the same person at the marketplace."""
    statement = update(identity).where(identity.c.participant_id == participant_id)
    db.write(statement.values(submission_id=submission_id, parameters=parameters))


def consent_of(db: DbSession, participant_id: str) -> ConsentRow:
    return ConsentRow._make(db.read(select(consent).where(consent.c.participant_id == participant_id)).one())


def allocation_of(db: DbSession, participant_id: str) -> AllocationRow:
    return AllocationRow._make(
        db.read(select(allocation).where(allocation.c.participant_id == participant_id)).one()
    )
