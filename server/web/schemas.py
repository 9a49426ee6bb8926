"""The bodies that the play API reads: strict, bounded, nothing extra.

All times are milliseconds of `performance.now()` or differences of it (DESIGN section 7).
"""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

DAY_MS = 86_400_000.0
Stamp = Annotated[float, Field(ge=0, le=1000 * DAY_MS, allow_inf_nan=False)]
Duration = Annotated[float, Field(ge=-DAY_MS, le=1000 * DAY_MS, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0, le=1_000_000)]
Ordinal = Annotated[int, Field(ge=0, le=1_000_000)]


class Body(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class Timing(Body):
    """What the browser measured around one decision."""

    onset_ms: Stamp
    response_ms: Stamp
    rt_ms: Duration
    handler_lag_ms: Duration
    wait_ms: Duration | None
    is_trusted: bool
    hidden: bool
    resumed: bool
    refresh_hz: Annotated[float, Field(ge=1e-3, le=10_000, allow_inf_nan=False)] | None
    dropped_frames: Count
    board_px: Annotated[int, Field(ge=0, le=100_000)]
    early_keys: Count
    input: Literal["key", "click"]


class StepBody(Body):
    """One decision: the `seq` that it makes, and the action."""

    round: Ordinal
    seq: Ordinal
    action: Annotated[int, Field(ge=0, le=255)]
    timing: Timing


class RoundBody(Body):
    """Asks for the round in hand (`after` null), or for the one after a finished round."""

    after: Ordinal | None


class BrowserEvent(Body):
    """Something that happened to the page, `at_ms` after it was loaded."""

    seq: Ordinal
    kind: Literal["focus", "blur", "visible", "hidden", "resize", "fullscreen", "windowed", "loaded"]
    value: Annotated[str, Field(max_length=40, pattern=r"^[0-9A-Za-z.:x -]*$")]
    """Of `resize` and `loaded` the window's inside, like 1280x720."""
    at_ms: Stamp


class BrowserLog(Body):
    """Some events of one visit to a page, in order; sent again they change nothing."""

    visit: Annotated[str, Field(pattern=r"^[0-9A-Za-z-]{8,40}$")]
    page: Annotated[str, Field(pattern=r"^[a-z]{1,20}(:[0-9]{1,3})?$")]
    events: Annotated[list[BrowserEvent], Field(max_length=200)]
