"""Do agents save messages up? The message rate in every stretch of five steps, beside the mean.

A budget holds over any contiguous part of an episode (Karten et al. 2023), so that a mean of .3 does not do:
an agent that talks through the first third and is silent afterwards has it too.

Shapes: T steps, B episodes, W windows.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.rollout import Rollout

WINDOW = 5
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


class Windows(NamedTuple):
    """Messages sent, and steps of living agents that may speak, in the windows from step w on: (B, W)."""

    sent: NDArray[np.float64]
    living: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Bursts:
    """Message rates in windows of five steps.

    Attributes:
        by_start: (W,) rate in the window from step w on, over all episodes; None where nobody lived.
        least: smallest of them.
        most: largest of them.
        single_quantiles: of the rates in single windows of single episodes, by percent, such as `q95`.
        single_least: smallest rate in a single window of one episode.
        single_most: largest.
    """

    by_start: tuple[float | None, ...]
    least: float
    most: float
    single_quantiles: dict[str, float]
    single_least: float
    single_most: float

    def to_json(self) -> dict[str, Any]:
        return {**asdict(self), "by_start": [None if x is None else round(x, 4) for x in self.by_start]}


def windows(rollout: Rollout, speaks: NDArray[np.bool_]) -> Windows:
    """Count in the windows of a rollout; `speaks` (N,) are the seats that may."""
    speaking = rollout.alive & speaks
    counts = (rollout.gates & speaking).sum(2), speaking.sum(2)  # (T, B)
    width = min(WINDOW, len(speaking))
    return Windows(*(sliding_window_view(count, width, axis=0).sum(-1).T.astype(float) for count in counts))


def bursts(counted: Windows) -> Bursts | None:
    """Rates of the windows; None if nobody lived in any."""
    lived = counted.living > 0
    if not lived.any():
        return None
    single = counted.sent[lived] / counted.living[lived]
    sent, living = counted.sent.sum(0), counted.living.sum(0)
    by_start = [float(s / n) if n else None for s, n in zip(sent, living, strict=True)]
    known = [rate for rate in by_start if rate is not None]
    quantiles = np.quantile(single, QUANTILES)
    return Bursts(
        tuple(by_start),
        min(known),
        max(known),
        {f"q{100 * share:02.0f}": float(value) for share, value in zip(QUANTILES, quantiles, strict=True)},
        float(single.min()),
        float(single.max()),
    )
