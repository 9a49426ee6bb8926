"""Erasing one person from a study: everything that is known of them, or that they did not take part.

Of what they were paid the amounts stay, without a name. Backups and files that were exported before are
beyond this; so is what the marketplace itself knows.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from server.domain.errors import BadInputError, NotFoundError
from server.domain.flow import ERASED
from server.domain.money import reward_minor
from server.services.lab import Lab
from server.services.session import definition_of
from server.storage import enrolments, erasure, participants, postings, refusals, studies
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow
from server.storage.studies import StudyRow

DIRECT = "direct"


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of somebody in a study: as a participant, as somebody who does not take part, or both."""

    study_id: int
    participant_id: str | None
    external_hash: str
    refusal: str | None
    """declined or screened_out."""
    rows: Mapping[str, int]
    """How many rows will go, by what they are."""
    payments: int
    """Payments whose amounts stay."""
    is_owed: bool
    """Money is due by the study's rule, and no payment of it is known."""

    @property
    def text(self) -> str:
        """In one line."""
        what = [f"{number} {name}" for name, number in self.rows.items() if number]
        if self.refusal:
            what.append(f"the note that they {'declined' if self.refusal == 'declined' else 'did not fit'}")
        who = (
            f"participant {self.participant_id}: identity, consent, allocation, "
            if self.participant_id
            else ""
        )
        kept = f"; {self.payments} payments stay as amounts" if self.payments else ""
        return who + (", ".join(what) or "no rows of data") + kept


def find_participant(db: DbSession, lab: Lab, slug: str, participant_id: str) -> Known:
    """Somebody by the pseudonym that exports and the monitor show.

    Raises:
        NotFoundError: no such study, or nobody of that name in it.
    """
    study = study_of(db, slug)
    row = participants.find(db, participant_id)
    if row is None or row.study_id != study.id:
        raise NotFoundError(f"nobody in {slug} is called {participant_id}")
    return known(db, lab, study, enrolments.identity_of(db, row.id).external_hash, row)


def find_external(db: DbSession, lab: Lab, slug: str, marketplace: str, external_id: str) -> Known:
    """Somebody by what a marketplace calls them.

    Raises:
        NotFoundError: no such study, or neither a participant nor a refusal of that name in it.
    """
    study = study_of(db, slug)
    hashed = lab.external_hash(marketplace, external_id)
    participant_id = enrolments.participant_of(db, study.id, marketplace, hashed)
    row = participants.by_id(db, participant_id) if participant_id else None
    found = known(db, lab, study, hashed, row)
    if row is None and found.refusal is None and not any(found.rows.values()):
        raise NotFoundError(f"nobody in {slug} is known under that id of {marketplace}")
    return found


def study_of(db: DbSession, slug: str) -> StudyRow:
    row = studies.by_slug(db, slug) if slug.isprintable() else None
    if row is None:
        raise NotFoundError(f"no study is called {slug}")
    return row


def known(db: DbSession, lab: Lab, study: StudyRow, external_hash: str, row: ParticipantRow | None) -> Known:
    refused = refusals.of(db, study.id, external_hash)
    told = {"submissions as told": erasure.submissions(db, study.id, external_hash)}
    paid = erasure.payments(db, row.id) if row else []
    return Known(
        study_id=study.id,
        participant_id=row.id if row else None,
        external_hash=external_hash,
        refusal=refused.status if refused else None,
        rows=(erasure.held(db, row.id) if row else {}) | told,
        payments=len(paid),
        is_owed=bool(row) and not paid and is_due(db, lab, row),
    )


def is_due(db: DbSession, lab: Lab, row: ParticipantRow | None) -> bool:
    """Whether the study's rule gives money to this person, who came from a marketplace."""
    if row is None or row.marketplace == DIRECT or row.mode != "live":
        return False
    pay = definition_of(db, lab, row.study_version_id).pay
    return pay is not None and reward_minor(pay, row.status) > 0


def erase(db: DbSession, who: Known) -> None:
    """Delete everything of `who`. The amounts that were paid stay, and name nobody.

    That somebody was there is counted on: in the flow of the study, by mode and arm.

    Raises:
        BadInputError: a payment is on its way; how it ends must be known first.
    """
    studies.hold(db, who.study_id)  # locks in the order of all others: study, postings, participant
    postings.hold_all(db, who.study_id)  # no payment begins, and nothing more is told of them, meanwhile
    row = participants.find(db, who.participant_id) if who.participant_id else None
    if row is not None:
        if erasure.SENT in erasure.payments(db, row.id):
            raise BadInputError("a payment of this person is on its way: look at it in Recruitment first")
        participants.hold(db, row.id)
        erasure.delete_person(db, row.id)
        erasure.count_one(db, row.study_id, row.mode, row.arm, ERASED)
    erasure.delete_submissions(db, who.study_id, who.external_hash)
    if (refused := refusals.of(db, who.study_id, who.external_hash)) is not None:
        refusals.delete_of(db, who.study_id, who.external_hash)
        erasure.count_one(db, who.study_id, refused.mode, "", refused.status)
