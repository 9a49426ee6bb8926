"""One text for one value: canonical JSON, its digests, and UTC times as text."""

import hashlib
import json
from datetime import UTC, datetime, timedelta
from typing import Any

ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def dumps(value: Any) -> str:
    """Canonical JSON: sorted keys, no spaces, no NaN or infinity.

    Raises:
        ValueError: a number that JSON cannot hold.
    """
    return ENCODER.encode(value)


def loads(text: str) -> Any:
    return json.loads(text)


def sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def utc_text(moment: datetime) -> str:
    """Milliseconds and a Z; texts of this form sort as their times do."""
    return moment.astimezone(UTC).isoformat(timespec="milliseconds")[: -len("+00:00")] + "Z"


def utc_moment(text: str) -> datetime:
    return datetime.strptime(text, "%Y-%m-%dT%H:%M:%S.%fZ").replace(tzinfo=UTC)


def minutes_before(moment: datetime, minutes: float) -> str:
    return utc_text(moment - timedelta(minutes=minutes))
