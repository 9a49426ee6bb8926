"""Timing values as a browser would send them: plausible, consistent, and drawn from the robot's seed."""

from random import Random
from typing import Any

FRAME_MS = 1000 / 60
RT_MEDIAN_MS, RT_SPREAD = 620.0, 0.45
"""Log-normal reaction times of the size that people show in such tasks."""


class Stopwatch:
    """A page clock that runs on with every decision; no real time passes."""

    def __init__(self, seed: str, index: int) -> None:
        self._random = Random(f"{seed}/{index}/time")  # noqa: S311 - play, not secrets
        self._clock_ms = 800.0 + self._random.random() * 400
        self._first = True

    def decision(self) -> dict[str, Any]:
        """Give the timing of the next decision."""
        wait_ms = 8 + self._random.expovariate(1 / 12)
        onset_ms = self._clock_ms + wait_ms + self._random.random() * FRAME_MS
        rt_ms = RT_MEDIAN_MS * self._random.lognormvariate(0, RT_SPREAD)
        response_ms = onset_ms + rt_ms
        self._clock_ms = response_ms
        first, self._first = self._first, False
        return {
            "onset_ms": round(onset_ms, 1),
            "response_ms": round(response_ms, 1),
            "rt_ms": round(round(response_ms, 1) - round(onset_ms, 1), 1),
            "handler_lag_ms": round(self._random.expovariate(1 / 0.6), 1),
            "wait_ms": None if first else round(wait_ms, 1),
            "is_trusted": False,
            "hidden": False,
            "resumed": False,
            "refresh_hz": 60.0,
            "dropped_frames": 0,
            "board_px": 560,
            "early_keys": 0,
            "input": "key",
        }
