"""HITs and assignments as plain values: what a posting becomes at MTurk, and what MTurk says of it."""

import hashlib
from collections.abc import Mapping
from datetime import datetime, timedelta
from decimal import Decimal
from typing import Any
from urllib.parse import urlsplit

from server.domain import canonical
from server.recruitment import mturk_xml as xml
from server.recruitment.recruiter import Posting, PostingState, RecruiterError, Submission, SubmissionState

SANDBOX = "https://mturk-requester-sandbox.us-east-1.amazonaws.com"
LIVE = "https://mturk-requester.us-east-1.amazonaws.com"
WORKER_SITES = {SANDBOX: "https://workersandbox.mturk.com", LIVE: "https://worker.mturk.com"}

AUTO_APPROVAL = timedelta(days=3)  # a lab that forgets pays; MTurk's own default is 30 days
CENTS = Decimal(100)
STATES: Mapping[str, SubmissionState] = {
    "Submitted": "awaiting_review",
    "Approved": "approved",
    "Rejected": "rejected",
}


def refuse_unfit(posting: Posting, endpoint: str) -> None:
    """What MTurk could not post.

    Raises:
        RecruiterError: it says what to change.
    """
    if posting.currency != "USD":
        raise RecruiterError(f"MTurk pays in US dollars, not {posting.currency}")
    if endpoint in WORKER_SITES and urlsplit(posting.entry_url).scheme != "https":
        raise RecruiterError("MTurk shows https pages only: set HATLAB_PUBLIC_URL to the https address")
    if posting.places < 1 or posting.reward_minor < 0:
        raise RecruiterError("a posting has at least one place, and a reward that is not negative")


def hit_type(posting: Posting, qualification: str) -> dict[str, Any]:
    needs = " You need a computer with a keyboard." if posting.desktop_only else ""
    return {
        "Title": posting.title,
        "Description": posting.description + needs,
        "Keywords": ", ".join(posting.keywords),
        "Reward": dollars(posting.reward_minor),
        "AssignmentDurationInSeconds": posting.time_limit_min * 60,
        "AutoApprovalDelayInSeconds": int(AUTO_APPROVAL.total_seconds()),
        "QualificationRequirements": [
            {
                "QualificationTypeId": qualification,
                "Comparator": "DoesNotExist",
                "ActionsGuarded": "DiscoverPreviewAndAccept",
            }
        ],
    }


def state_of(hit: Mapping[str, Any], now: datetime) -> PostingState:
    """Where a HIT stands; one that expired with places left is called paused."""
    if hit["HITStatus"] == "Disposed" or hit["NumberOfAssignmentsCompleted"] >= hit["MaxAssignments"]:
        return "completed"
    taken = hit["NumberOfAssignmentsAvailable"] == 0
    if hit["HITStatus"] in {"Reviewable", "Reviewing"} and taken:
        return "awaiting_review"
    return "paused" if hit["Expiration"] <= now else "active"


def submission_of(assignment: Mapping[str, Any], bonuses: Mapping[str, int]) -> Submission:
    return Submission(
        id=assignment["AssignmentId"],
        external_id=assignment["WorkerId"],
        state=STATES[assignment["AssignmentStatus"]],
        code=xml.code_of(assignment.get("Answer", "")),
        started_utc=canonical.utc_text(assignment["AcceptTime"]),
        completed_utc=canonical.utc_text(assignment["SubmitTime"]),
        bonus_minor=bonuses.get(assignment["AssignmentId"], 0),
    )


def dollars(cents: int) -> str:
    return f"{Decimal(cents) / CENTS:.2f}"


def minor(amount: str) -> int:
    return int((Decimal(amount) * CENTS).to_integral_value())


def mark(*words: str) -> str:
    """A request token: 64 characters, the same for the same words."""
    return hashlib.sha256("\0".join(words).encode()).hexdigest()
