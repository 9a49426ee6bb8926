"""What became of the cars in each seat while a human trial lasted, the participant's seat among them.

Shapes: T steps, B episodes, N seats.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from models.rollout import trials

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.rollout import Rollout

    Counts = NDArray[np.int64]


class Occupancies(NamedTuple):
    """Cars that had each seat during the trial, and those that shared a cell with another: (B, N)."""

    cars: Counts
    collided: Counts


def occupancies(rollout: Rollout) -> Occupancies:
    """Count the cars of each seat from the first state of the trial to the one that ends it.

    A seat whose car arrives may get another one at once: that is a second occupancy.
    """
    alive = np.concatenate((rollout.alive, _alive_at_the_end(rollout)[None]))  # (T + 1, B, N)
    lasts = trials(rollout).steps  # (B,)
    before = np.zeros_like(alive[0])
    hit = np.zeros_like(alive[0])
    cars, collided = np.zeros(before.shape, np.int64), np.zeros(before.shape, np.int64)
    for step, here in enumerate(alive):
        during = (step <= lasts)[:, None]
        begins = here & (~before | rollout.completed[step])
        hit &= ~begins
        meets = rollout.collided[step] & here
        cars += begins & during
        collided += meets & ~hit & during
        hit |= meets
        before = here
    return Occupancies(cars, collided)


def _alive_at_the_end(rollout: Rollout) -> NDArray[np.bool_]:
    """Who lives in the last state (B, N): who did not leave, and newcomers if they are in a collision."""
    stayed = rollout.alive[-1] & ~rollout.completed[-1]
    return np.asarray(stayed | rollout.collided[-1])
