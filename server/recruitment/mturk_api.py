"""Mechanical Turk as a recruiter, through its requester API.

**A posting's id is `HITTYPE:QUALIFICATIONTYPE`.** Both ids are given by MTurk and both are found again for
the same posting (equal HIT types get equal ids; the qualification type bears the study's name): nothing has
to be kept between two calls. The posting's HIT is the HIT of that type which requires that qualification.

What MTurk has no word for: a draft has no HIT yet; a place that somebody holds without having handed in is
only counted, never listed; nobody can be screened out with less than the reward. Money is US dollars.
Source: the MTurk API reference of 2017-01-17.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import Any

from server.recruitment import mturk_draft as drafts
from server.recruitment import mturk_xml as xml
from server.recruitment.arrival import Marketplace
from server.recruitment.mturk_client import MTurkClient, RefusedError
from server.recruitment.mturk_draft import Draft
from server.recruitment.mturk_hit import (
    CENTS,
    SANDBOX,
    WORKER_SITES,
    dollars,
    hit_type,
    mark,
    minor,
    refuse_unfit,
    state_of,
    submission_of,
)
from server.recruitment.recruiter import Bonus, Paid, Posted, Posting, RecruiterError, Submission

FRAME_PX = 0  # the frame takes the window, which the trial pages need
LIFETIME = timedelta(days=30)
PAST = timedelta(minutes=1)  # a clock that is a little ahead must not leave a pause in the future
SMALL = 10  # a HIT of fewer assignments stays below it for ever (MTurk's fee changes there)
FEE = Decimal("0.20")  # of a bonus, beside it
DONE_BEFORE = "already been processed"
"""What MTurk says of a token that it knows; documented as "an error with a message", without a code."""
MARK = re.compile(r"\[payment (.{1,64})\]$")
RETURN_SUBJECT = "Please return a HIT"
NOT_YET = "MTurk does not know the assignment {id} as handed in: try again in a minute"

WorkerOf = Callable[[str], str | None]
"""Who holds an assignment, by our own records: MTurk tells only of those that were handed in."""


class MTurkRecruiter:
    """The `Recruiter` of one MTurk account, in the sandbox or live as the client's endpoint says."""

    marketplace: Marketplace = "mturk"
    settle_s = 0.0
    """A bonus is named, and MTurk lists the name: sending it again is safe at any time."""

    def __init__(
        self,
        client: MTurkClient,
        endpoint: str = SANDBOX,
        worker_of: WorkerOf = lambda _: None,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self._client = client
        self._endpoint = endpoint.rstrip("/")
        self._worker_of = worker_of
        self._now = now
        self._hits: dict[str, str] = {}  # spares a list of all HITs at every question

    def create(self, posting: Posting) -> Posted:
        """Register the HIT type and the qualification; both are the same ones at a second call."""
        refuse_unfit(posting, self._endpoint)
        draft = Draft(posting.places, posting.entry_url)
        qualification = drafts.keep(self._client, posting.slug, draft)
        made = self._client.ask("create_hit_type", **hit_type(posting, qualification))
        return self.posted(f"{made['HITTypeId']}:{qualification}")

    def posted(self, posting_id: str) -> Posted:
        hit = self._hit(posting_id)
        if hit is None:
            return Posted(posting_id, "draft", drafts.read(self._client, qualification_of(posting_id)).places)
        site = WORKER_SITES.get(self._endpoint)
        url = f"{site}/projects/{hit['HITGroupId']}/tasks" if site else f"{self._endpoint}/"
        return Posted(posting_id, state_of(hit, self._now()), int(hit["MaxAssignments"]), url)

    def publish(self, posting_id: str) -> Posted:
        """Make the HIT, or give it time again."""
        hit = self._hit(posting_id)
        if hit is None:
            self._make_hit(posting_id)
        elif hit["Expiration"] <= self._now():
            self._expire(hit["HITId"], self._now() + LIFETIME)
        return self.posted(posting_id)

    def pause(self, posting_id: str) -> Posted:
        """Let the HIT expire; who holds an assignment may still hand it in."""
        hit = self._hit(posting_id)
        if hit is not None and hit["Expiration"] > self._now():
            self._expire(hit["HITId"], self._now() - PAST)
        return self.posted(posting_id)

    def set_places(self, posting_id: str, places: int) -> Posted:
        """Add assignments.

        Raises:
            RecruiterError: fewer than before, or a HIT of fewer than 10 would get 10 or more.
        """
        hit = self._hit(posting_id)
        before = int(hit["MaxAssignments"]) if hit else self.posted(posting_id).places
        if places < before:
            raise RecruiterError(f"MTurk cannot take places back: there are {before}")
        if hit is None:
            draft = drafts.read(self._client, qualification_of(posting_id))
            drafts.rewrite(self._client, qualification_of(posting_id), Draft(places, draft.entry_url))
        elif places > before:
            self._add_places(hit, places)
        return self.posted(posting_id)

    def submissions(self, posting_id: str) -> Sequence[Submission]:
        """Everybody who handed in; who is still at it has no entry at MTurk."""
        hit = self._hit(posting_id)
        if hit is None:
            return ()
        bonuses: dict[str, int] = {}
        for paid in self._client.every("list_bonus_payments", "BonusPayments", HITId=hit["HITId"]):
            key = paid["AssignmentId"]
            bonuses[key] = bonuses.get(key, 0) + minor(paid["BonusAmount"])
        return [submission_of(each, bonuses) for each in self._assignments(hit["HITId"])]

    def approve(self, submission_id: str) -> None:
        """Pay the reward.

        Raises:
            RecruiterError: not handed in yet (again), or somebody rejected it by hand.
        """
        try:
            self._client.ask("approve_assignment", AssignmentId=submission_id)
        except RefusedError as error:
            if error.again or (state := self._state(submission_id)) == "Submitted":
                raise
            if state is None:
                raise RecruiterError(NOT_YET.format(id=submission_id), again=True) from None
            if state == "Rejected":
                raise RecruiterError(
                    f"assignment {submission_id} was rejected by hand: overturn that on MTurk"
                ) from None

    def ask_for_return(self, submission_id: str, reason: str) -> None:
        """Write to the worker; MTurk has no request of its own.

        Raises:
            RecruiterError: handed in already (no return after that), nobody knows who holds it, or MTurk does
                not pass mail on to this worker (it does so to people whose work you once reviewed).
        """
        if self._state(submission_id) is not None:
            raise RecruiterError(f"assignment {submission_id} is handed in: MTurk takes no return after that")
        worker = self._worker_of(submission_id)
        if worker is None:
            raise RecruiterError(f"MTurk does not say who holds the assignment {submission_id}")
        answer = self._client.ask(
            "notify_workers", Subject=RETURN_SUBJECT, MessageText=reason, WorkerIds=[worker]
        )
        for failure in answer.get("NotifyWorkersFailureStatuses", ()):
            soft = failure["NotifyWorkersFailureCode"] == "SoftFailure"
            told = failure.get("NotifyWorkersFailureMessage", "")
            raise RecruiterError(f"MTurk did not pass the message on: {told}", again=soft)

    def screen_out(self, posting_id: str, submission_ids: Sequence[str]) -> None:  # noqa: ARG002
        """Approve them. MTurk has no screen-out: whoever handed in gets the whole reward, or a rejection."""
        for each in submission_ids:
            self.approve(each)

    def pay_bonuses(self, posting_id: str, bonuses: Sequence[Bonus]) -> Sequence[Paid]:
        """Pay them one by one, after checking all: amounts, people, and the balance with MTurk's fee.

        MTurk forgets a request token after a day; the payment's name therefore also ends the reason, and what
        is listed under it is not paid again. Should MTurk fail between two payments, the same call pays the
        rest.
        """
        hit = self._hit(posting_id)
        if hit is None:
            raise RecruiterError("nobody has taken part yet: the HIT is not published")
        paid = self._paid(hit["HITId"])
        due = {bonus.request: bonus for bonus in bonuses if bonus.request not in paid}
        self._check(hit["HITId"], tuple(due.values()))
        for bonus in due.values():
            self._send(hit["HITId"], bonus)
        return [Paid(bonus.request, bonus.request) for bonus in bonuses]

    def paid_bonuses(self, posting_id: str) -> Mapping[str, Sequence[int]]:
        """Amounts of the bonuses that each assignment was paid."""
        found: dict[str, list[int]] = {}
        hit = self._hit(posting_id)
        if hit is not None:
            for paid in self._client.every("list_bonus_payments", "BonusPayments", HITId=hit["HITId"]):
                found.setdefault(paid["AssignmentId"], []).append(minor(paid["BonusAmount"]))
        return found

    def remember(self, posting_id: str, external_id: str) -> None:
        """Keep a worker from this study, also from a later posting of it: call it when they took part."""
        self._client.ask(
            "associate_qualification_with_worker",
            QualificationTypeId=qualification_of(posting_id),
            WorkerId=external_id,
            IntegerValue=1,
            SendNotification=False,
        )

    def close(self) -> None:
        self._client.close()

    def _hit(self, posting_id: str) -> dict[str, Any] | None:
        """The newest HIT of the posting."""
        if known := self._hits.get(posting_id):
            found: dict[str, Any] = self._client.ask("get_hit", HITId=known)["HIT"]
            return found
        kind, qualification = parts(posting_id)
        ours = self._client.every(
            "list_hits_for_qualification_type", "HITs", QualificationTypeId=qualification
        )
        hits = sorted((hit for hit in ours if hit["HITTypeId"] == kind), key=lambda hit: hit["CreationTime"])
        if not hits:
            return None
        self._hits[posting_id] = hits[-1]["HITId"]
        return hits[-1]

    def _make_hit(self, posting_id: str) -> None:
        kind, qualification = parts(posting_id)
        draft = drafts.read(self._client, qualification)
        try:
            made = self._client.ask(
                "create_hit_with_hit_type",
                HITTypeId=kind,
                MaxAssignments=draft.places,
                LifetimeInSeconds=int(LIFETIME.total_seconds()),
                Question=xml.external_question(draft.entry_url, FRAME_PX),
                RequesterAnnotation=posting_id,
                UniqueRequestToken=mark("publish", posting_id),
            )
        except RefusedError as error:
            if "alreadyexists" not in error.code.lower():
                raise
            raise RecruiterError(
                "MTurk has made the HIT but does not list it yet: try again in a minute", again=True
            ) from None
        self._hits[posting_id] = made["HIT"]["HITId"]

    def _expire(self, hit_id: str, at: datetime) -> None:
        try:
            self._client.ask("update_expiration_for_hit", HITId=hit_id, ExpireAt=at)
        except RefusedError as error:
            if DONE_BEFORE not in str(error):
                raise

    def _add_places(self, hit: Mapping[str, Any], places: int) -> None:
        before = int(hit["MaxAssignments"])
        if before < SMALL <= places:
            raise RecruiterError(
                f"MTurk never lets a HIT of fewer than {SMALL} places grow to {SMALL} or more: it can have "
                f"{SMALL - 1}; for more, post the study with {SMALL} or more from the start"
            )
        try:
            self._client.ask(
                "create_additional_assignments_for_hit",
                HITId=hit["HITId"],
                NumberOfAdditionalAssignments=places - before,
                UniqueRequestToken=mark("places", hit["HITId"], str(places)),
            )
        except RefusedError as error:
            if DONE_BEFORE not in str(error):
                raise

    def _assignments(self, hit_id: str) -> Iterator[dict[str, Any]]:
        return self._client.every("list_assignments_for_hit", "Assignments", HITId=hit_id)

    def _state(self, assignment_id: str) -> str | None:
        """Submitted, Approved, Rejected; None: not handed in."""
        try:
            found = self._client.ask("get_assignment", AssignmentId=assignment_id)
        except RefusedError as error:
            if error.again:
                raise
            return None
        return str(found["Assignment"]["AssignmentStatus"])

    def _paid(self, hit_id: str) -> set[str]:
        """Names of the payments that MTurk lists."""
        listed = self._client.every("list_bonus_payments", "BonusPayments", HITId=hit_id)
        return {found[1] for each in listed if (found := MARK.search(each["Reason"]))}

    def _check(self, hit_id: str, bonuses: Sequence[Bonus]) -> None:
        if not bonuses:
            return
        workers = {each["AssignmentId"]: each["WorkerId"] for each in self._assignments(hit_id)}
        for bonus in bonuses:
            if bonus.amount_minor <= 0:
                raise RecruiterError(f"a bonus of {bonus.amount_minor} cents cannot be paid: {bonus.request}")
            if bonus.submission_id not in workers:
                raise RecruiterError(NOT_YET.format(id=bonus.submission_id), again=True)
            if workers[bonus.submission_id] != bonus.external_id:
                raise RecruiterError(f"assignment {bonus.submission_id} is somebody else's: nothing was paid")
        needed = sum(bonus.amount_minor for bonus in bonuses) * (1 + FEE) / CENTS
        there = Decimal(self._client.ask("get_account_balance")["AvailableBalance"])
        if there < needed:
            raise RecruiterError(
                f"the bonuses and MTurk's fee come to ${needed:.2f}, and the account has ${there:.2f}: "
                "nothing was paid"
            )

    def _send(self, hit_id: str, bonus: Bonus) -> None:
        try:
            self._client.ask(
                "send_bonus",
                WorkerId=bonus.external_id,
                AssignmentId=bonus.submission_id,
                BonusAmount=dollars(bonus.amount_minor),
                Reason=f"{bonus.reason} [payment {bonus.request}]",
                UniqueRequestToken=bonus.request,
            )
        except RefusedError as error:
            if error.again or (DONE_BEFORE not in str(error) and bonus.request not in self._paid(hit_id)):
                raise


def parts(posting_id: str) -> tuple[str, str]:
    kind, colon, qualification = posting_id.partition(":")
    if not (kind and colon and qualification):
        raise RecruiterError(f"{posting_id} is not the id of a posting at MTurk")
    return kind, qualification


def qualification_of(posting_id: str) -> str:
    return parts(posting_id)[1]
