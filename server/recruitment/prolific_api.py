"""Prolific's side of recruitment: studies, places, submissions. Bonuses are in `prolific_bonuses`."""

from collections.abc import Mapping, Sequence
from typing import Final

import httpx
from pydantic import SecretStr

from server.recruitment.arrival import Marketplace
from server.recruitment.prolific_bonuses import SETTLED_S, Bonuses
from server.recruitment.prolific_http import Connection, LostError, RefusedError
from server.recruitment.prolific_lookup import (
    draft_named,
    sitting,
    sittings,
    study,
    study_path,
    submission_path,
)
from server.recruitment.prolific_wire import Sitting, Study, draft, read
from server.recruitment.recruiter import (
    Bonus,
    Paid,
    Posted,
    Posting,
    RecruiterError,
    Submission,
    UncertainError,
)

RETURNABLE: Final = {"reserved", "active", "awaiting_review", "timed_out"}
SCREENABLE: Final = {"active", "awaiting_review"}
WHY_NOT_APPROVED: Final = {
    "returned": "was given back: offer a bonus if the person is to be paid",
    "timed_out": "timed out: ask the person by message to hand in at Prolific",
    "rejected": "was rejected at Prolific: undo that there first",
    "screened_out": "was screened out, and paid for that",
}


class ProlificRecruiter:
    """The Recruiter of one Prolific account; keep one for the life of a process (it remembers bonuses).

    Args:
        connection: To the API, with the account's key.
        approve_automatically: Whether Prolific pays at once whoever hands in the code of completion.
        screen_out_minor: What somebody gets who is screened out; None: screening out is refused.
        project: Project that new studies go to; None: Prolific's default.
    """

    marketplace: Marketplace = "prolific"

    def __init__(
        self,
        connection: Connection,
        *,
        approve_automatically: bool = False,
        screen_out_minor: int | None = None,
        project: str | None = None,
        settle_s: float = SETTLED_S,
    ) -> None:
        self._connection = connection
        self._approve_automatically = approve_automatically
        self._screen_out_minor = screen_out_minor
        self._project = project
        self.settle_s = settle_s
        self._bonuses = Bonuses(connection)

    @classmethod
    def open(
        cls, api: str, token: SecretStr, transport: httpx.BaseTransport | None = None
    ) -> "ProlificRecruiter":
        """By the settings `prolific_api` and `prolific_token`."""
        return cls(Connection(api, token, transport=transport))

    def close(self) -> None:
        self._connection.close()

    def create(self, posting: Posting) -> Posted:
        """Make a draft; an equal one that was never published is it again."""
        body = draft(
            posting,
            approve_automatically=self._approve_automatically,
            screening=self._screen_out_minor is not None,
            project=self._project,
        )
        found = self._draft(body["name"], body["internal_name"])
        if found is not None:
            return found.posted()
        try:
            return read(Study, self._connection.post("/studies/", body)).posted()
        except LostError as lost:
            reason = str(lost)
        found = self._draft(body["name"], body["internal_name"])
        if found is None:
            raise RecruiterError(reason, again=True)
        return found.posted()

    def posted(self, posting_id: str) -> Posted:
        return study(self._connection, posting_id).posted()

    def publish(self, posting_id: str) -> Posted:
        """Publish a draft, start after a pause; one that recruits or is full stays as it is."""
        found = study(self._connection, posting_id)
        if found.condition == "SCHEDULED":
            raise RecruiterError(
                "the study is scheduled at Prolific: cancel that there, then publish it here"
            )
        if found.condition == "COMPLETED":
            raise RecruiterError("the study is over at Prolific: add places, and it recruits again")
        action = {"UNPUBLISHED": "PUBLISH", "PAUSED": "START"}.get(found.condition)
        return self._moved(found, action).posted() if action else found.posted()

    def pause(self, posting_id: str) -> Posted:
        """Pause; one that lets nobody in anyway stays as it is."""
        found = study(self._connection, posting_id)
        if found.condition == "PUBLISHING":
            raise RecruiterError("Prolific is still publishing: pause it again in a minute", again=True)
        return self._moved(found, "PAUSE").posted() if found.condition == "ACTIVE" else found.posted()

    def set_places(self, posting_id: str, places: int) -> Posted:
        """Raise the number of places; a full study recruits again by that."""
        found = study(self._connection, posting_id)
        offered = found.total_available_places
        if places < offered:
            raise RecruiterError(f"Prolific takes no places away: it offers {offered}, ask for that or more")
        if places > offered:
            answer = self._connection.patch(study_path(posting_id), {"total_available_places": places})
            found = read(Study, answer)
        return found.posted()

    def submissions(self, posting_id: str) -> Sequence[Submission]:
        return [each.submission() for each in sittings(self._connection, posting_id).values()]

    def submission(self, submission_id: str) -> Submission:
        """One of them, with the bonuses it was paid."""
        return sitting(self._connection, submission_id).submission()

    def approve(self, submission_id: str) -> None:
        """Pay the reward of a submission that awaits review."""
        if is_approved(sitting(self._connection, submission_id)):
            return
        path = submission_path(submission_id, "transition")
        try:
            self._connection.post(path, {"action": "APPROVE"}, repeatable=True)  # documented as idempotent
        except RefusedError as refused:
            reason = refused
        else:
            return
        if not is_approved(sitting(self._connection, submission_id)):  # unless somebody else was faster
            raise reason

    def ask_for_return(self, submission_id: str, reason: str) -> None:
        """Ask once: whoever was asked, or has returned it, gets no second message."""
        found = sitting(self._connection, submission_id)
        if found.state == "returned" or found.return_requested:
            return
        if found.state not in RETURNABLE:
            raise RecruiterError(f"submission {submission_id} is {found.state}: it cannot be given back")
        try:
            path = submission_path(submission_id, "request-return")
            self._connection.post(path, {"request_return_reasons": [reason]})
        except LostError as lost:
            message = str(lost)
        else:
            return
        if not sitting(self._connection, submission_id).return_requested:
            raise RecruiterError(message, again=True)

    def screen_out(self, posting_id: str, submission_ids: Sequence[str]) -> None:
        """Screen out whoever is not yet, and open their places again.

        Raises:
            UncertainError: the answer was lost; the same call looks first and does what is left.
        """
        if self._screen_out_minor is None:
            raise RecruiterError("nobody said what a person gets who is screened out: set that amount first")
        found = sittings(self._connection, posting_id)
        todo = [each for each in dict.fromkeys(submission_ids) if must_be_screened_out(found.get(each), each)]
        if not todo:
            return
        body = {
            "submission_ids": todo,
            "bonus_per_submission": self._screen_out_minor / 100,
            "increase_places": True,
        }
        try:
            self._connection.post(study_path(posting_id, "screen-out-submissions"), body)
        except LostError as lost:
            reason = str(lost)
        else:
            return
        raise UncertainError(reason)

    def pay_bonuses(self, posting_id: str, bonuses: Sequence[Bonus]) -> Sequence[Paid]:
        """Pay those not paid yet; `prolific_bonuses` says what that promises and what callers keep."""
        return self._bonuses.pay(posting_id, bonuses)

    def paid_bonuses(self, posting_id: str) -> Mapping[str, tuple[int, ...]]:
        """Amounts of bonuses that each submission was paid: the look before anything is sent again."""
        return self._bonuses.paid(posting_id)

    def remember(self, posting_id: str, external_id: str) -> None:
        """Nothing: Prolific lets nobody take a study twice."""

    def _draft(self, title: str, internal_name: str) -> Study | None:
        return draft_named(self._connection, title, internal_name)

    def _moved(self, before: Study, action: str) -> Study:
        """Change the state. A refusal may mean that somebody was faster: the state decides."""
        try:
            path = study_path(before.id, "transition")
            return read(Study, self._connection.post(path, {"action": action}, repeatable=True))
        except RefusedError as refused:
            reason = refused
        now = study(self._connection, before.id)
        if now.condition == before.condition:
            raise reason
        return now


def is_approved(found: Sitting) -> bool:
    """Whether the reward is paid; false: it can be.

    Raises:
        RecruiterError: it cannot, or not yet.
    """
    if found.state in {"reserved", "active"}:
        raise RecruiterError(
            f"submission {found.id} is not handed in at Prolific yet: try again in some minutes", again=True
        )
    if found.state in WHY_NOT_APPROVED:
        raise RecruiterError(f"submission {found.id} {WHY_NOT_APPROVED[found.state]}")
    return found.state != "awaiting_review"


def must_be_screened_out(found: Sitting | None, submission_id: str) -> bool:
    """Whether that is still to be done.

    Raises:
        RecruiterError: it cannot be.
    """
    if found is None:
        raise RecruiterError(f"the study has no submission {submission_id} at Prolific")
    if found.state not in SCREENABLE | {"screened_out"}:
        raise RecruiterError(
            f"submission {submission_id} is {found.state}: it cannot be screened out any more"
        )
    return found.state != "screened_out"
