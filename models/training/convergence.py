"""When had a run learned its task? The first evaluation from which a criterion held twenty times in a row.

Source: the twenty evaluations are this project's definition (the public code computes no convergence).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

IN_A_ROW = 20


@dataclass(frozen=True, slots=True)
class Criterion:
    """What an evaluation has to show."""

    least: float
    """Least value of the column."""
    column: str = "success"
    """``success``, ``reward`` or ``score`` of the log."""
    rate: float | None = None
    """Message rate to be kept, or None for any."""
    tolerance: float = 0.02
    """Farthest that the message rate may lie from it, either way."""

    def holds(self, row: Mapping[str, str]) -> bool:
        """Whether one line of the log meets it; what is empty or not a number does not."""
        good = float(row[self.column] or "nan") >= self.least
        if self.rate is None:
            return good
        return good and abs(float(row["message_rate"] or "nan") - self.rate) <= self.tolerance + 1e-9


class Converged(NamedTuple):
    """Where it was reached, over all phases."""

    update: int
    env_steps: int


def converged(
    rows: Iterable[Mapping[str, str]], criterion: Criterion, in_a_row: int = IN_A_ROW
) -> Converged | None:
    """Where the first series of so many good evaluations begins; None if there is none."""
    first, held = None, 0
    for row in rows:
        good = criterion.holds(row)
        held = held + 1 if good else 0
        if held == 1:
            first = Converged(int(row["total"]), int(row["env_steps"]))
        if held >= in_a_row:
            return first
    return None
