"""Rows of recruitment: postings, their submissions as last told, and what was paid or asked for."""

from collections.abc import Sequence
from typing import NamedTuple

from sqlalchemy import delete, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from server.storage.database import DbSession
from server.storage.tables import identity, participant, payment, posting, refusal, submission, webhook_event


class PostingRow(NamedTuple):
    id: int
    study_id: int
    marketplace: str
    external_id: str
    state: str
    places: int
    content: str
    created_utc: str
    polled_utc: str | None


class SubmissionRow(NamedTuple):
    posting_id: int
    id: str
    external_hash: str
    state: str
    code: str
    bonus_minor: int
    told_by: str
    told_utc: str


class PaymentRow(NamedTuple):
    request: str
    posting_id: int
    participant_id: str
    submission_id: str
    kind: str
    amount_minor: int
    currency: str
    state: str
    """sent: on its way, or nobody knows; done; failed: it was not paid, and may be tried again."""
    reference: str
    detail: str
    asked_by: str
    asked_utc: str
    done_utc: str | None


class OursRow(NamedTuple):
    """Somebody who came from a marketplace, with what tells them apart there."""

    participant_id: str
    external_hash: str
    submission_id: str | None
    status: str
    completion_code: str | None
    study_version_id: int | None
    """The version that they entered; None for who never did."""
    mode: str


PAYMENT, POSTING = select(payment), select(posting)
ROBOT = "robot"


def add(
    db: DbSession, study_id: int, marketplace: str, external_id: str, state: str, places: int, content: str,
    now_utc: str,
) -> int:  # fmt: skip
    statement = insert(posting).returning(posting.c.id)
    return int(
        db.write(
            statement,
            {
                "study_id": study_id,
                "marketplace": marketplace,
                "external_id": external_id,
                "state": state,
                "places": places,
                "content": content,
                "created_utc": now_utc,
            },
        ).scalar_one()
    )


def of_study(db: DbSession, study_id: int) -> list[PostingRow]:
    statement = POSTING.where(posting.c.study_id == study_id).order_by(posting.c.id)
    return [PostingRow._make(row) for row in db.read(statement)]


def by_id(db: DbSession, posting_id: int) -> PostingRow | None:
    row = db.read(POSTING.where(posting.c.id == posting_id)).one_or_none()
    return PostingRow._make(row) if row else None


def by_external_id(db: DbSession, marketplace: str, external_id: str) -> PostingRow | None:
    statement = POSTING.where(posting.c.marketplace == marketplace, posting.c.external_id == external_id)
    row = db.read(statement).one_or_none()
    return PostingRow._make(row) if row else None


def of_submission(
    db: DbSession, marketplace: str, submission_id: str, external_id: str = ""
) -> PostingRow | None:
    """The posting of a submission: by its own name, by what was told before, or by who came in under it."""
    if external_id:
        return by_external_id(db, marketplace, external_id)
    told_before = select(submission.c.posting_id).where(submission.c.id == submission_id)
    came_in = select(identity.c.study_id).where(
        identity.c.marketplace == marketplace, identity.c.submission_id == submission_id
    )
    mine = POSTING.where(posting.c.marketplace == marketplace)
    for statement in (mine.where(posting.c.id.in_(told_before)), mine.where(posting.c.study_id.in_(came_in))):
        if (row := db.read(statement.order_by(posting.c.id.desc()).limit(1)).one_or_none()) is not None:
            return PostingRow._make(row)
    return None


def hold(db: DbSession, posting_id: int) -> PostingRow:
    """The posting, locked until the transaction ends: one payment run at a time."""
    db.hold()
    statement = POSTING.where(posting.c.id == posting_id).with_for_update()
    return PostingRow._make(db.read(statement).one())


def hold_all(db: DbSession, study_id: int) -> None:
    """All postings of a study, likewise, always in the same order; before any participant is held."""
    db.hold()
    db.read(
        select(posting.c.id).where(posting.c.study_id == study_id).order_by(posting.c.id).with_for_update()
    )


def told(db: DbSession, posting_id: int, state: str, places: int) -> None:
    db.write(update(posting).where(posting.c.id == posting_id).values(state=state, places=places))


def polled(db: DbSession, posting_id: int, now_utc: str) -> None:
    db.write(update(posting).where(posting.c.id == posting_id).values(polled_utc=now_utc))


def keep_submissions(db: DbSession, rows: Sequence[SubmissionRow]) -> None:
    """Store what was told last of each; the caller holds the posting."""
    db.hold()
    for row in rows:
        key = (submission.c.posting_id == row.posting_id) & (submission.c.id == row.id)
        if not db.write(update(submission).where(key).values(row._asdict())).rowcount:
            db.write(insert(submission), row._asdict())


def submissions(db: DbSession, posting_id: int) -> list[SubmissionRow]:
    statement = select(submission).where(submission.c.posting_id == posting_id).order_by(submission.c.id)
    return [SubmissionRow._make(row) for row in db.read(statement)]


def told_elsewhere(db: DbSession, row: PostingRow) -> set[str]:
    """Submissions to the same study that its other postings at this marketplace were told of."""
    others = select(posting.c.id).where(
        posting.c.study_id == row.study_id,
        posting.c.marketplace == row.marketplace,
        posting.c.id != row.id,
    )
    return set(db.read(select(submission.c.id).where(submission.c.posting_id.in_(others))).scalars())


def people(db: DbSession, study_id: int, marketplace: str) -> list[OursRow]:
    """Everybody of the study who came from this marketplace, and who declined or was screened out there.

    A study may have gone from test to live mode after it was posted: a submission is a person's in both.
    """
    entered = (
        select(
            participant.c.id,
            identity.c.external_hash,
            identity.c.submission_id,
            participant.c.status,
            participant.c.completion_code,
            participant.c.study_version_id,
            participant.c.mode,
        )
        .join(identity, identity.c.participant_id == participant.c.id)
        .where(participant.c.study_id == study_id, participant.c.mode != ROBOT)
        .where(identity.c.marketplace == marketplace)
        .order_by(participant.c.id)
    )
    found = [OursRow._make(row) for row in db.read(entered)]
    known = {row.external_hash for row in found}
    refused = select(refusal.c.external_hash, refusal.c.status, refusal.c.mode).where(
        refusal.c.study_id == study_id, refusal.c.mode != ROBOT
    )
    refusals = [tuple(row) for row in db.read(refused)]
    return found + [
        OursRow("", who, None, status, None, None, mode) for who, status, mode in refusals if who not in known
    ]


def external_id_of(db: DbSession, participant_id: str) -> str:
    """The marketplace's own name of a person: to pay them, and for nothing else."""
    statement = select(identity.c.external_id).where(identity.c.participant_id == participant_id)
    return str(db.read(statement).scalar_one())


def external_id_of_submission(db: DbSession, marketplace: str, submission_id: str) -> str | None:
    """Who came in under a submission, by the marketplace's own name."""
    statement = select(identity.c.external_id).where(
        identity.c.marketplace == marketplace, identity.c.submission_id == submission_id
    )
    return db.read(statement.limit(1)).scalar_one_or_none()


def participant_of_submission(
    db: DbSession, study_id: int, marketplace: str, submission_id: str
) -> str | None:
    statement = select(identity.c.participant_id).where(
        identity.c.study_id == study_id,
        identity.c.marketplace == marketplace,
        identity.c.submission_id == submission_id,
    )
    return db.read(statement).scalar_one_or_none()


def ledger(db: DbSession, study_id: int) -> list[PaymentRow]:
    """Everything that was paid or asked for in a study, the newest first."""
    statement = PAYMENT.join(posting, posting.c.id == payment.c.posting_id).where(
        posting.c.study_id == study_id
    )
    ordered = statement.order_by(payment.c.asked_utc.desc(), payment.c.request)
    return [PaymentRow._make(row) for row in db.read(ordered)]


def spent(db: DbSession, study_id: int) -> dict[str, int]:
    """Minor units paid or on their way, by participant."""
    statement = (
        select(payment.c.participant_id, func.sum(payment.c.amount_minor))
        .join(posting, posting.c.id == payment.c.posting_id)
        .where(posting.c.study_id == study_id, payment.c.state != "failed")
        .group_by(payment.c.participant_id)
    )
    found: dict[str, int] = {}
    for row in db.read(statement):
        who, number = list(row)
        found[who] = int(number)
    return found


def payment_of(db: DbSession, request: str) -> PaymentRow | None:
    row = db.read(PAYMENT.where(payment.c.request == request)).one_or_none()
    return PaymentRow._make(row) if row else None


def begin_payment(db: DbSession, row: PaymentRow) -> None:
    """Write down that money is on its way; one that failed before is begun again."""
    db.write(delete(payment).where(payment.c.request == row.request, payment.c.state == "failed"))
    db.write(insert(payment), row._asdict())


def end_payment(db: DbSession, request: str, state: str, reference: str, detail: str, now_utc: str) -> None:
    values = {"state": state, "reference": reference, "detail": detail, "done_utc": now_utc}
    still = (payment.c.request == request) & (payment.c.state == "sent")  # what is done stays done
    db.write(update(payment).where(still).values(values))


def is_new_event(db: DbSession, marketplace: str, event_id: str, now_utc: str) -> bool:
    """Whether a webhook's event came for the first time; it counts as come from now on."""
    db.hold()
    row = {"marketplace": marketplace, "id": event_id, "received_utc": now_utc}
    try:
        with db.connection.begin_nested():
            db.write(insert(webhook_event), row)
    except IntegrityError:
        return False
    return True
