"""Reconciling: what differs from the marketplace, and doing what an experimenter has confirmed.

A payment is written down and committed as `sent` before it is asked for, and as `done` after. Whatever was
interrupted in between is looked at before anything is sent again. Every request is named after the submission
and the purpose, so that it happens once, whoever presses how often and whichever worker dies.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import get_args

from server.domain import canonical, reconciliation
from server.domain.errors import HatlabError
from server.domain.money import bonus_minor
from server.domain.reconciliation import Mismatch, Ours, OverCapError, Theirs
from server.domain.study import Pay
from server.recruitment.recruiter import Bonus, Recruiter, RecruiterError, UncertainError
from server.services import recruit
from server.services.lab import Lab
from server.services.pages import WON
from server.services.recruit import Place
from server.services.recruiters import SITES, recruiter
from server.services.session import definition_of
from server.storage import postings, trials
from server.storage.database import DbSession
from server.storage.postings import OursRow, PaymentRow

SENT, DONE, FAILED = "sent", "done", "failed"
RETURN_REASON = "Your session at the study did not come to its end there. Please return your place."
REASONS = {"bonus": "Bonus for your rounds in the study", "partial": "For your time in the study"}


@dataclass(frozen=True, slots=True)
class Found:
    """What the page of the reconciler shows of one posting."""

    place: Place
    mismatches: tuple[Mismatch, ...]
    ledger: tuple[PaymentRow, ...]
    spent_minor: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one confirmed mismatch."""

    key: str
    done: bool
    says: str


def look(db: DbSession, lab: Lab, posting_id: int) -> Found:
    """Compare what is stored here with what the marketplace told last."""
    place = recruit.place_of(db, lab, posting_id)
    ledger = [row for row in postings.ledger(db, place.row.study_id) if row.posting_id == posting_id]
    states = {reconciliation.key_of(kind_of(row), row.submission_id): row.state for row in ledger}
    theirs = [
        Theirs(row.id, row.external_hash, row.state, row.code) for row in postings.submissions(db, posting_id)
    ]
    ours = people(db, lab, place)
    found = reconciliation.mismatches(ours, theirs, states, pay_at(place), SITES[place.row.marketplace])
    spent = sum(postings.spent(db, place.row.study_id).values())
    return Found(place, tuple(found), tuple(ledger), spent)


def pay_at(place: Place) -> Pay | None:
    """The study's pay as the marketplace pays it.

    The reward is that of the posting, whatever a later version offers; where a marketplace has no parts, a
    screen-out costs the reward.
    """
    if place.study.pay is None:
        return None
    offered = canonical.loads(place.row.content).get("reward_minor", place.study.pay.reward_minor)
    pay = place.study.pay.model_copy(update={"reward_minor": offered})
    if SITES[place.row.marketplace].pays_in_parts:
        return pay
    return pay.model_copy(update={"screen_out_minor": pay.reward_minor})


def kind_of(row: PaymentRow) -> reconciliation.ActionKind:
    known: tuple[reconciliation.ActionKind, ...] = get_args(reconciliation.ActionKind)
    return next((kind for kind in known if kind == row.kind), "look")


def people(db: DbSession, lab: Lab, place: Place) -> list[Ours]:
    """Everybody of the posting's study who came from its marketplace, in whichever mode the study was then.

    Bonus and partial pay are those of the version which each of them entered, as their pages say.
    """
    wins = trials.won(db, place.row.study_id, WON)
    elsewhere = postings.told_elsewhere(db, place.row)

    def ours(row: OursRow) -> Ours:
        pay = definition_of(db, lab, row.study_version_id).pay if row.study_version_id else None
        return Ours(
            row.participant_id,
            row.external_hash,
            row.submission_id or "",
            row.status,
            row.completion_code or "",
            bonus_minor(pay, wins.get(row.participant_id, 0)),
            pay.partial_minor if pay else 0,
            must_be_listed=row.mode == place.mode and row.submission_id not in elsewhere,
        )

    return [ours(row) for row in postings.people(db, place.row.study_id, place.row.marketplace)]


def confirm(lab: Lab, posting_id: int, keys: Sequence[str], asked_by: str) -> list[Outcome]:
    """Do what was confirmed, one after the other; what is no mismatch any more is left alone."""
    place = recruit.opened(lab, posting_id)
    with recruiter(lab, place.row.marketplace, place.study) as there:
        return [confirm_one(lab, there, posting_id, key, asked_by) for key in keys]


def confirm_one(lab: Lab, there: Recruiter, posting_id: int, key: str, asked_by: str) -> Outcome:
    """Do one thing, or say why not."""
    try:
        with lab.database.writing() as db:
            begun = begin(db, lab, posting_id, key, asked_by)
    except (HatlabError, OverCapError) as error:
        return Outcome(key, False, str(error))
    if isinstance(begun, Outcome):
        return begun
    place, mismatch, external_id, before = begun
    request = request_of(mismatch)
    try:
        if before is not None and mismatch.action in {"bonus", "partial"}:
            reference = looked_at(lab, there, place, mismatch, before)
            if reference is None:
                reference = do(there, place, mismatch, external_id)
        else:
            reference = do(there, place, mismatch, external_id)
    except UncertainError as error:
        return end(lab, request, mismatch.key, SENT, "", str(error))
    except RecruiterError as error:
        return end(lab, request, mismatch.key, FAILED, "", str(error))
    return end(lab, request, mismatch.key, DONE, reference, "")


Begun = tuple[Place, Mismatch, str, PaymentRow | None]


def begin(db: DbSession, lab: Lab, posting_id: int, key: str, asked_by: str) -> Begun | Outcome:
    """Write down that something is on its way, if it is still to be done and within the caps."""
    place = recruit.place_of(db, lab, posting_id)
    postings.hold_all(db, place.row.study_id)  # the caps are the study's, whichever posting is paid
    found = look(db, lab, posting_id)
    mismatch = next((each for each in found.mismatches if each.key == key), None)
    if mismatch is None:
        return Outcome(key, True, "nothing to do any more")
    if mismatch.action == "look":
        return Outcome(key, False, "this one needs a person: nothing can be done from here")
    if mismatch.action == "follow":
        submissions = {row.id: row for row in postings.submissions(db, posting_id)}
        recruit.follow(db, lab, found.place, submissions[mismatch.submission_id])
        return Outcome(key, True, "our state follows theirs")
    before = postings.payment_of(db, request_of(mismatch))
    if before is None or before.state == FAILED:
        spent = postings.spent(db, found.place.row.study_id)
        so_far = spent.get(mismatch.participant_id, 0) if mismatch.participant_id else 0
        reconciliation.check_caps(found.place.study.pay, mismatch.amount_minor, so_far, sum(spent.values()))
        postings.begin_payment(db, payment_row(lab, found.place, mismatch, asked_by))
        before = None
    else:
        mismatch = replace(mismatch, amount_minor=before.amount_minor)  # the very payment that was begun
    external_id = ""
    if mismatch.participant_id:
        external_id = postings.external_id_of(db, mismatch.participant_id)
    return found.place, mismatch, external_id, before


def request_of(mismatch: Mismatch) -> str:
    """The name of what is asked for, the same at every attempt."""
    return f"hatlab-{mismatch.action}-{mismatch.submission_id}"[:64]


def payment_row(lab: Lab, place: Place, mismatch: Mismatch, asked_by: str) -> PaymentRow:
    pay = place.study.pay
    return PaymentRow(
        request=request_of(mismatch),
        posting_id=place.row.id,
        participant_id=mismatch.participant_id,
        submission_id=mismatch.submission_id,
        kind=mismatch.action,
        amount_minor=mismatch.amount_minor,
        currency=pay.currency if pay else "",
        state=SENT,
        reference="",
        detail="",
        asked_by=asked_by,
        asked_utc=lab.now_utc(),
        done_utc=None,
    )


def do(there: Recruiter, place: Place, mismatch: Mismatch, external_id: str) -> str:
    """Ask the marketplace; its name for what it did."""
    posting, submission = place.row.external_id, mismatch.submission_id
    if mismatch.action == "approve":
        there.approve(submission)
    elif mismatch.action == "screen_out":
        there.screen_out(posting, [submission])
    elif mismatch.action == "ask_return":
        there.ask_for_return(submission, RETURN_REASON)
    else:
        reason = REASONS[mismatch.action]
        bonus = Bonus(submission, external_id, mismatch.amount_minor, reason, request_of(mismatch))
        return there.pay_bonuses(posting, [bonus])[0].reference
    return ""


def looked_at(lab: Lab, there: Recruiter, place: Place, mismatch: Mismatch, before: PaymentRow) -> str | None:
    """Whether a payment that was interrupted went out after all; None: it did not, and may be sent.

    Raises:
        UncertainError: it is too early to tell.
    """
    settled_utc = canonical.minutes_before(lab.now(), there.settle_s / 60)
    if before.asked_utc > settled_utc:
        raise UncertainError("was interrupted; whether it was paid can be told only later: try again then")
    paid = there.paid_bonuses(place.row.external_id)
    return "seen there" if mismatch.amount_minor in paid.get(mismatch.submission_id, ()) else None


def end(lab: Lab, request: str, key: str, state: str, reference: str, says: str) -> Outcome:
    with lab.database.writing() as db:
        postings.end_payment(db, request, state, reference, says, lab.now_utc())
    return Outcome(key, state == DONE, says or "done")


def confirmable(found: Found) -> tuple[str, ...]:
    """Keys of everything that can be done from here."""
    return tuple(each.key for each in found.mismatches if each.action != "look")
