"""What hatlab asks of a marketplace, whichever it is: one protocol, and the plain values that go through it.

Money is in minor units (cents, pence) of the account's currency. A recruiter knows nothing of our database;
it says what the marketplace says. It never rejects anybody: there is no such method.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

from server.recruitment.arrival import Marketplace

Code = Literal["complete", "screened_out", "failed", "withdrawn"]
"""Outcomes that have a code of their own."""

PostingState = Literal["draft", "active", "paused", "awaiting_review", "completed"]

SubmissionState = Literal[
    "reserved",
    "active",
    "awaiting_review",
    "approved",
    "partially_approved",
    "returned",
    "timed_out",
    "rejected",
    "screened_out",
]


class RecruiterError(Exception):
    """The marketplace did not do it; the message says what to do and holds no key of ours.

    `again` is true where the same request may succeed later (busy, unreachable, too early).
    """

    def __init__(self, message: str, *, again: bool = False) -> None:
        super().__init__(message)
        self.again = again


class UncertainError(RecruiterError):
    """Money may have gone out or not: nobody may send it again before looking at what was paid."""


@dataclass(frozen=True, slots=True)
class Posting:
    """A study as a marketplace offers it."""

    slug: str
    title: str
    description: str
    entry_url: str
    """Address of the study's entry page, without parameters."""
    places: int
    duration_min: int
    time_limit_min: int
    reward_minor: int
    currency: str
    codes: Mapping[Code, str]
    keywords: tuple[str, ...] = ()
    desktop_only: bool = True


@dataclass(frozen=True, slots=True)
class Posted:
    """A posting at the marketplace: its id there, its state, how many places it offers, its page there."""

    id: str
    state: PostingState
    places: int
    url: str = ""


@dataclass(frozen=True, slots=True)
class Submission:
    """One sitting of one person, as the marketplace tells it. `code` is what was handed in, if anything."""

    id: str
    external_id: str
    state: SubmissionState
    code: str = ""
    started_utc: str = ""
    completed_utc: str = ""
    bonus_minor: int = 0
    """Bonus paid so far, where the marketplace tells."""


@dataclass(frozen=True, slots=True)
class Bonus:
    """Money beside the reward. The same `request` is paid once, however often it is sent."""

    submission_id: str
    external_id: str
    amount_minor: int
    reason: str
    request: str
    """Name of this payment, the same at every attempt, unique to it; at most 64 characters."""


@dataclass(frozen=True, slots=True)
class Paid:
    """What came of a bonus; `reference` is the marketplace's name for the payment."""

    request: str
    reference: str


class Recruiter(Protocol):
    """One marketplace. Every method may raise RecruiterError; all are safe to repeat."""

    marketplace: Marketplace
    settle_s: float
    """How long after a bonus was asked for `paid_bonuses` tells for certain whether it was paid."""

    def create(self, posting: Posting) -> Posted:
        """Make a draft (or what comes nearest: nobody is recruited before `publish`)."""
        ...

    def posted(self, posting_id: str) -> Posted:
        """How it stands there."""
        ...

    def publish(self, posting_id: str) -> Posted:
        """Start recruiting, or go on after a pause."""
        ...

    def pause(self, posting_id: str) -> Posted:
        """Let nobody new in; who has begun may finish."""
        ...

    def set_places(self, posting_id: str, places: int) -> Posted:
        """Offer so many places in all; never fewer than before."""
        ...

    def submissions(self, posting_id: str) -> Sequence[Submission]:
        """Everybody who took a place so far, all pages of it."""
        ...

    def approve(self, submission_id: str) -> None:
        """Pay the reward. Nothing happens if it was paid already."""
        ...

    def ask_for_return(self, submission_id: str, reason: str) -> None:
        """Ask the person to give the place back."""
        ...

    def screen_out(self, posting_id: str, submission_ids: Sequence[str]) -> None:
        """End submissions of people whom the study could not take, with the screen-out pay."""
        ...

    def pay_bonuses(self, posting_id: str, bonuses: Sequence[Bonus]) -> Sequence[Paid]:
        """Pay every one of them, or raise before anything was paid; UncertainError: nobody knows which."""
        ...

    def paid_bonuses(self, posting_id: str) -> Mapping[str, Sequence[int]]:
        """Amounts of the bonuses that each submission was paid so far."""
        ...

    def remember(self, posting_id: str, external_id: str) -> None:
        """Keep somebody from taking part again, where the marketplace does not do so by itself."""
        ...


@dataclass(frozen=True, slots=True)
class Change:
    """What a webhook says: a submission has another state. `event_id` makes it idempotent.

    `posting_id` is empty where the marketplace names only the submission.
    """

    event_id: str
    posting_id: str
    submission: Submission
    raw: Mapping[str, str] = field(default_factory=dict)
