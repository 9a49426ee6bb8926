"""Does a message tell what its speaker does in the same step, gas or brake?

Where a car is already tells something about what it does. So what the token tells stands beside what the cell
alone tells, and beside what the token adds for somebody who knows the cell.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from models.envs.traffic_junction import GAS
from models.interpret.shared import Shared, pair, shared

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.interpret.turns import Turns


class Deeds(NamedTuple):
    """Gas or brake, of cars whose message was sent; K tokens."""

    gas: NDArray[np.float64]
    """(K,) P(gas | token), NaN for a token that was not said."""
    gas_overall: float
    """P(gas); NaN if nothing was said."""
    uses: NDArray[np.int64]
    """(K,)"""
    token: Shared
    """What the token tells about the action."""
    cell: Shared
    """What the cell alone tells about it."""
    beyond_cell_bits: float
    """What the token adds to the cell."""


def deeds(said: Turns, tokens: int) -> Deeds:
    """Compare messages that were sent with what their speakers did."""
    uses = np.bincount(said.token, minlength=tokens).astype(np.int64)
    gas = np.bincount(said.token[said.action == GAS], minlength=tokens)
    share = np.divide(gas, uses, out=np.full(tokens, np.nan), where=uses > 0)
    place = shared(said.cell, said.action)
    both = shared(pair(said.token, said.cell), said.action)
    overall = float(gas.sum() / uses.sum()) if uses.sum() else float("nan")
    return Deeds(
        share, overall, uses, shared(said.token, said.action), place, max(both.bits - place.bits, 0.0)
    )
