"""What a run has cost so far: wall and processor seconds, over all its resumptions."""

import time
from dataclasses import dataclass, field


@dataclass(slots=True)
class Clock:
    """Two running sums, which grow between ``begin`` and each ``lap``."""

    seconds: float = 0.0
    """Wall time."""
    cpu_s: float = 0.0
    """Processor time of this process, all its threads."""
    _since: tuple[float, float] = field(default=(0.0, 0.0), repr=False)

    def begin(self) -> None:
        """Count from now on."""
        self._since = _now()

    def lap(self) -> None:
        """Add what has passed since ``begin`` or the last lap."""
        now = _now()
        self.seconds += now[0] - self._since[0]
        self.cpu_s += now[1] - self._since[1]
        self._since = now


def _now() -> tuple[float, float]:
    return time.perf_counter(), time.process_time()
