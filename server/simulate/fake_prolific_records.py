"""What the fake marketplace keeps, what it refuses, and how it reads and writes amounts and times."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from decimal import Decimal, InvalidOperation
from math import ceil, sqrt
from typing import Any, Final, Literal

NEEDED: Final = (
    "name",
    "description",
    "external_study_url",
    "prolific_id_option",
    "completion_codes",
    "total_available_places",
    "estimated_completion_time",
    "reward",
    "device_compatibility",
)
REJECTION_LENGTH = 100
FEE = Decimal("0.33")  # of a bonus; tax is on the fee only
TAX = Decimal("0.2")

Kind = Literal["reward", "bonus", "screen_out"]


class Refusal(Exception):  # noqa: N818 (an answer of the fake, not an error of ours)
    """What Prolific answers instead of doing it."""

    def __init__(self, status: int, detail: object, title: str = "Bad request") -> None:
        super().__init__(str(detail))
        self.status = status
        self.body = {
            "error": {"status": status, "error_code": status * 1000, "title": title, "detail": detail}
        }


@dataclass(slots=True)
class Study:
    id: str
    fields: dict[str, Any]
    status: str = "UNPUBLISHED"
    published_s: float = 0.0
    stopped: bool = False

    @property
    def places(self) -> int:
        return int(self.fields["total_available_places"])


@dataclass(slots=True)
class Submission:
    id: str
    study_id: str
    participant_id: str
    taken_s: float
    status: str = "RESERVED"
    completed_s: float | None = None
    code: str | None = None
    return_requested_s: float | None = None
    handed_in: tuple[float, str] | None = None
    """Time at which a code that was handed in takes effect, and the code."""


@dataclass(slots=True)
class Bulk:
    id: str
    study_id: str
    amounts: list[tuple[str, int]] = field(default_factory=list)
    """Submission ids and minor units."""


@dataclass(frozen=True, slots=True)
class Payment:
    submission_id: str
    participant_id: str
    kind: Kind
    amount_minor: int
    shown_s: float
    bulk_id: str = ""


def check_study(fields: Mapping[str, Any]) -> None:
    """Refuse what Prolific would refuse."""
    missing = [each for each in NEEDED if fields.get(each) in (None, "")]
    if missing:
        raise Refusal(400, {each: ["This field is required"] for each in missing})
    codes = fields["completion_codes"]
    if not codes or len({each["code"] for each in codes}) < len(codes):
        raise Refusal(400, {"completion_codes": ["Each code must be unique"]})
    for each in codes:
        if {"AUTOMATICALLY_APPROVE", "MANUALLY_REVIEW"} <= {one["action"] for one in each["actions"]}:
            raise Refusal(400, {"completion_codes": ["Approve and review cannot be used together"]})
    if not str(fields["external_study_url"]).startswith(("https://", "http://")):
        raise Refusal(400, {"external_study_url": ["Enter a valid URL"]})
    for each in ("total_available_places", "reward", "estimated_completion_time"):
        if not float(fields[each]) > 0:
            raise Refusal(400, {each: ["Must be above zero"]})
    least = least_time_min(float(fields["estimated_completion_time"]))
    if float(fields.get("maximum_allowed_time", least)) < least:
        raise Refusal(400, {"maximum_allowed_time": [f"Must be at least {least}"]})


def least_time_min(estimated_min: float) -> int:
    return ceil(2 + 2 * estimated_min + 2 * sqrt(estimated_min))


def check_rejection(body: Mapping[str, Any]) -> None:
    if len(str(body.get("message", ""))) < REJECTION_LENGTH or not body.get("rejection_category"):
        raise Refusal(400, {"message": ["At least 100 characters, and a category"]})


def minor(amount: object) -> int:
    """An amount like 1.50 in minor units."""
    try:
        cents = Decimal(str(amount)) * 100
    except InvalidOperation:
        cents = Decimal(0)
    if not cents.is_finite() or cents <= 0 or cents != cents.to_integral_value():
        raise Refusal(400, f"{amount} is not an amount")
    return int(cents)


def cost(amounts: Iterable[int]) -> dict[str, float]:
    """What a bulk costs, in minor units."""
    amount = Decimal(sum(amounts))
    fees = amount * FEE
    tax = fees * TAX
    parts = {"amount": amount, "fees": fees, "vat": tax, "total_amount": amount + fees + tax}
    return {name: float(value) for name, value in parts.items()}


def stamp(seconds: float | None) -> str | None:
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC).isoformat()
