"""Labels for the warm start in Traffic Junction: front car first, with caution.

The rule sees every car; the learner sees only itself and hears the others, visits its own states and is told
there what the rule would do. Messages are learned through the listeners' gradient. Nobody is ever served the
rule.

A car on its way to a junction brakes if its next cell is taken now, unless it stands on its entry cell, where
another car may appear on it; it brakes if a car of higher rank enters the same cell, or if its next cell is
held by a car that brakes. Rank: inside a junction first, then further along the route, then the lower route.
Whoever is inside a junction or past the last one follows only the last two rules and therefore never has to
wait for long.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from models.envs.traffic_junction import BRAKE, GAS, TrafficJunction, TrafficState

Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]


def labels(env: TrafficJunction, state: TrafficState) -> Ints:
    """Return what the rule would do (B, N); BRAKE for empty slots."""
    here = env.cell_of(state)
    ahead = intent(env, state)
    tables = _tables(env)
    last = env.route_cells.shape[1] - 1
    position = np.minimum(state.position, last)
    rank = (tables.junction[state.route, position] * (last + 1) + position) * len(env.routes) + state.route
    pair = (ahead >= 0)[:, :, None] & ~np.eye(env.agents, dtype=np.bool_)  # (B, N, N): i's way, j in it
    holds = pair & (ahead[:, :, None] == here[:, None, :])
    yields = pair & (ahead[:, :, None] == ahead[:, None, :]) & (rank[:, None, :] > rank[:, :, None])
    careful = tables.approach[state.route, position] & (position > 0) & holds.any(2)
    moving = state.alive & ~careful
    while True:
        still = moving & ~((yields & moving[:, None, :]) | (holds & ~moving[:, None, :])).any(2)
        if (still == moving).all():
            return np.where(moving, GAS, BRAKE).astype(np.int32)
        moving = still


def intent(env: TrafficJunction, state: TrafficState) -> Ints:
    """Return the cell that each car would enter with gas (B, N); -1 out of the grid or for empty slots."""
    ahead = state.position + 1
    leads_on = state.alive & (ahead < env.route_length[state.route])
    last = env.route_cells.shape[1] - 1
    return np.where(leads_on, env.route_cells[state.route, np.minimum(ahead, last)], np.int32(-1))


@dataclass(frozen=True, slots=True)
class _Tables:
    """By route and position: is the cell a junction's, does a junction lie ahead of it."""

    junction: Bools
    approach: Bools


@cache
def _tables(env: TrafficJunction) -> _Tables:
    inside = np.isin(env.route_cells, env.roads.junction_cells)  # (R, L)
    later = np.flip(np.logical_or.accumulate(np.flip(inside, 1), 1), 1)
    return _Tables(inside, later & ~inside)
