"""Prolific's studies and submissions as its API writes them, and what they are in our words.

Source: the OpenAPI description at docs.prolific.com. A submission has other names for the same things in a
list (`participant_id`, `study_code`) than by itself (`participant`, `entered_code`), and no bonuses there.
"""

import hashlib
import json
from collections.abc import Mapping
from math import ceil, sqrt
from typing import Any, Final, TypeVar

from pydantic import AliasChoices, BaseModel, Field, ValidationError

from server.recruitment import prolific
from server.recruitment.recruiter import (
    Code,
    Posted,
    Posting,
    PostingState,
    RecruiterError,
    Submission,
    SubmissionState,
)

STUDY_PAGE = "https://app.prolific.com/researcher/studies/"
NO_CODE = "NOCODE"  # what Prolific writes where somebody handed in without a code
STUDY_STATES: Final[Mapping[str, PostingState]] = {
    "UNPUBLISHED": "draft",
    "SCHEDULED": "draft",
    "PUBLISHING": "active",
    "ACTIVE": "active",
    "PAUSED": "paused",
    "AWAITING REVIEW": "awaiting_review",
    "COMPLETED": "completed",
}
SUBMISSION_STATES: Final[Mapping[str, SubmissionState]] = {
    "RESERVED": "reserved",
    "ACTIVE": "active",
    "TIMED OUT": "timed_out",
    "AWAITING REVIEW": "awaiting_review",
    "APPROVED": "approved",
    "PARTIALLY APPROVED": "partially_approved",
    "RETURNED": "returned",
    "REJECTED": "rejected",
    "SCREENED OUT": "screened_out",
    "UNKNOWN": "active",  # documented, never explained: it holds a place and nobody may pay it yet
}
CODE_TYPES: Final[Mapping[Code, str]] = {
    "complete": "COMPLETED",
    "screened_out": "SCREENED_OUT",
    "failed": "FAILED_ATTENTION_CHECK",
    "withdrawn": "OTHER",
}


class Study(BaseModel):
    id: str
    status: str
    total_available_places: int = 0
    name: str = ""
    internal_name: str | None = None

    @property
    def condition(self) -> str:
        """Its status in one spelling; Prolific writes `AWAITING REVIEW`, `AWAITING_REVIEW`, `TIMED-OUT`."""
        return plain(self.status)

    def posted(self) -> Posted:
        state = STUDY_STATES.get(self.condition)
        if state is None:
            raise unknown("study", self.id, self.status)
        return Posted(self.id, state, self.total_available_places, STUDY_PAGE + self.id)


class Sitting(BaseModel):
    """One submission; `bonus_payments` are amounts already paid, in minor units."""

    id: str
    participant: str | None = Field(None, validation_alias=AliasChoices("participant", "participant_id"))
    status: str
    study_id: str = ""
    code: str | None = Field(None, validation_alias=AliasChoices("entered_code", "study_code"))
    started_at: str | None = None
    completed_at: str | None = None
    bonus_payments: list[float] | None = None
    return_requested: str | None = None

    @property
    def state(self) -> SubmissionState:
        return submission_state(self.id, self.status)

    @property
    def bonuses_minor(self) -> tuple[int, ...]:
        return tuple(round(amount) for amount in self.bonus_payments or ())

    def submission(self) -> Submission:
        return Submission(
            id=self.id,
            external_id=self.participant or "",
            state=self.state,
            code="" if self.code in {None, NO_CODE} else str(self.code),
            started_utc=self.started_at or "",
            completed_utc=self.completed_at or "",
            bonus_minor=sum(self.bonuses_minor),
        )


class Count(BaseModel):
    count: int


class SittingPage(BaseModel):
    results: list[Sitting]
    meta: Count | None = None


class StudyList(BaseModel):
    results: list[Study]


class Bulk(BaseModel):
    """Bonuses set up and not paid yet. `total_amount` is what leaves the account, fees and tax included."""

    id: str
    total_amount: float


Shape = TypeVar("Shape", bound=BaseModel)


def read(shape: type[Shape], body: Any) -> Shape:
    """The answer as a value.

    Raises:
        RecruiterError: it lacks what the API describes.
    """
    try:
        return shape.model_validate(body)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the answer"
    raise RecruiterError(f"Prolific's answer is not as described ({where}): check HATLAB_PROLIFIC_API")


def plain(status: str) -> str:
    return status.strip().upper().replace("_", " ").replace("-", " ")


def submission_state(submission_id: str, status: str) -> SubmissionState:
    state = SUBMISSION_STATES.get(plain(status))
    if state is None:
        raise unknown("submission", submission_id, status)
    return state


def unknown(what: str, its_id: str, status: str) -> RecruiterError:
    return RecruiterError(
        f"Prolific says {what} {its_id} is {status!r}, which hatlab does not know: look there, update hatlab"
    )


def draft(
    posting: Posting, *, approve_automatically: bool, screening: bool, project: str | None
) -> dict[str, Any]:
    """The body that makes a study. Its internal name tells this very posting from all others.

    Amounts are in the account's currency, whatever the posting says: the API has no other.
    """
    body: dict[str, Any] = {
        "name": posting.title,
        "description": posting.description,
        "external_study_url": entry_url(posting.entry_url),
        "prolific_id_option": "url_parameters",
        "completion_option": "url",
        "completion_codes": completion_codes(posting.codes, approve_automatically),
        "total_available_places": posting.places,
        "estimated_completion_time": posting.duration_min,
        "maximum_allowed_time": time_limit_min(posting),
        "reward": posting.reward_minor,
        "device_compatibility": ["desktop"] if posting.desktop_only else [],
        "peripheral_requirements": [],
        "filters": [],
    }
    if screening:
        body["is_custom_screening"] = True  # else Prolific refuses to screen anybody out
    if project:
        body["project"] = project
    return body | {"internal_name": f"hatlab {posting.slug} {fingerprint(body)}"}


def entry_url(address: str) -> str:
    """The entry page with the placeholders that Prolific fills in for each person."""
    return address + ("&" if "?" in address else "?") + prolific.PLACEHOLDERS


def completion_codes(codes: Mapping[Code, str], approve_automatically: bool) -> list[dict[str, Any]]:
    """Only who completed may be paid without a look; everybody else waits for a person's decision."""
    automatic = {"complete"} if approve_automatically else set()
    return [
        {
            "code": code,
            "code_type": CODE_TYPES[outcome],
            "actor": "participant",
            "actions": [{"action": "AUTOMATICALLY_APPROVE" if outcome in automatic else "MANUALLY_REVIEW"}],
        }
        for outcome, code in codes.items()
    ]


def time_limit_min(posting: Posting) -> int:
    """At least what Prolific asks for: two minutes, twice the duration, twice its root."""
    least = 2 + 2 * posting.duration_min + 2 * sqrt(posting.duration_min)
    return max(posting.time_limit_min, ceil(least))


def fingerprint(body: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(body, sort_keys=True).encode()).hexdigest()[:12]


def decimal(minor: int) -> str:
    """Minor units as the API wants amounts: 150 is 1.50. Both of Prolific's currencies have two places."""
    return f"{minor // 100}.{minor % 100:02d}"
