"""The Enforcer: a PID penalty that holds the share of communication at a budget.

With c the observed share of messages and b the budget,

    R_P = (b - c) / b if c <= b else (b - c) / (1 - b),    R_D = change of R_P,    R_I = sum of R_P, |R_I| <
    K, penalty = scale * |P R_P + D R_D + I R_I|.

The magnitude is taken: read as a signed sum, the formula would pay for talking too much. A budget of 1 is the
open gate and has no penalty above it. History (the previous and the summed R_P) runs over updates, on the
mean over episodes.

Source: Karten et al. 2023, Enforcers; constants from there, scale from the authors' code.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

PROPORTION, CHANGE, SUM = 1.0, 1.6, 0.026
K = 50.0
SCALE = 0.1

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Enforcer:
    """The controller of one phase: budget and what it remembers."""

    budget: float
    previous: float = 0.0
    """Mean R_P at the last update."""
    total: float = 0.0
    """Sum of the mean R_P so far, R_I."""

    def penalty(self, share: Floats) -> Floats:
        """Penalty (B,) of episodes with these shares of communication (B,)."""
        now = proportional(share, self.budget)
        return SCALE * np.abs(PROPORTION * now + CHANGE * (now - self.previous) + SUM * self.total)

    def after(self, share: Floats) -> "Enforcer":
        """The controller once these shares (B,) have been seen."""
        now = float(proportional(share, self.budget).mean())
        return Enforcer(self.budget, now, float(np.clip(self.total + now, -K, K)))


def proportional(share: Floats, budget: float) -> Floats:
    """R_P: 0 on the budget, 1 for silence, -1 for talking all the time."""
    above = (budget - share) / (1 - budget) if budget < 1 else np.zeros_like(share)
    return np.where(share <= budget, (budget - share) / budget, above)


def silence(share: Floats) -> Floats:
    """Penalty (B,) of the phase that rewards communication: proportional to |1 - c|."""
    return SCALE * np.abs(1 - share)
