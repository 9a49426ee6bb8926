"""When had a run learned its task? The first evaluation from which a criterion held twenty times in a row.

A run that ended while the criterion held, but had not held twenty times yet, may have learned its task:
nobody can tell, and it is not said that it never did.

Source: the twenty evaluations are this project's definition (the public code computes no convergence).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
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


class Unreached(StrEnum):
    """Why there is no such place."""

    NEVER = "never"
    """The criterion was not met, or was lost again before it had held long enough."""
    TOO_SHORT = "too short to tell"
    """It was met and held to the end, but the end came too early."""


def converged(
    rows: Iterable[Mapping[str, str]], criterion: Criterion, in_a_row: int = IN_A_ROW
) -> Converged | Unreached:
    """Where the first series of so many good evaluations begins, or why there is none."""
    first, held = Converged(0, 0), 0
    for row in rows:
        held = held + 1 if criterion.holds(row) else 0
        if held == 1:
            first = Converged(int(row["total"]), int(row["env_steps"]))
        if held >= in_a_row:
            return first
    return Unreached.TOO_SHORT if held else Unreached.NEVER
