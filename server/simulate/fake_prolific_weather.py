"""What goes wrong on the way to the fake marketplace: too many requests, delays, lost answers. Seeded."""

import threading
from dataclasses import dataclass
from random import Random
from typing import Literal

RETRY_AFTER_S = 1
When = Literal["before", "after"]


@dataclass(slots=True)
class Fault:
    """The next `times` requests whose `METHOD path` contains `match` are answered with `status`.

    `after`: the thing is done all the same, only its answer is lost.
    """

    match: str
    status: int
    when: When = "before"
    times: int = 1


class Weather:
    """Decides about each request.

    Args:
        limit_429: Share of requests that are answered 429, undone; every other one says when to come again.
        delay_s: Longest delay of an answer.
    """

    def __init__(self, seed: int = 0, *, limit_429: float = 0.0, delay_s: float = 0.0) -> None:
        self.faults: list[Fault] = []
        self._random = Random(f"weather/{seed}")  # noqa: S311 (a simulation)
        self._limit_429 = limit_429
        self._delay_s = delay_s
        self._lock = threading.Lock()

    def is_busy(self) -> bool:
        with self._lock:
            return self._random.random() < self._limit_429

    def retry_after(self) -> dict[str, str]:
        """The header, or none: Prolific does not promise it."""
        with self._lock:
            return {"Retry-After": str(RETRY_AFTER_S)} if self._random.random() < 0.5 else {}

    def delay_s(self) -> float:
        with self._lock:
            return self._random.uniform(0, self._delay_s)

    def strike(self, request: str) -> Fault | None:
        """The fault that meets this request, used up by that."""
        with self._lock:
            for fault in self.faults:
                if fault.times > 0 and fault.match in request:
                    fault.times -= 1
                    return fault
        return None
