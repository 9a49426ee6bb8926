"""Labels for the warm start in Traffic Junction: front car first, careful or not.

The rule sees every car; the learner sees only itself and hears the others, visits its own states and is told
there what the rule would do. Messages are learned through the listeners' gradient. Nobody is ever served the
rule.

A car brakes if a car of higher rank enters the same cell, or if its next cell is held by a car that brakes.
Rank: inside a junction first, then further along the route, then the lower route. Where people drive too, the
rule is careful: a car brakes if its next cell is taken at all, even if that car will probably leave it, since
people brake when they like, and whoever follows too closely hits them. Two exceptions: on the entry cell,
where another car may appear on it, and while the junction is full, which would lock.
"""

import numpy as np
from numpy.typing import NDArray

from models.envs.traffic_junction import BRAKE, GAS, TrafficJunction, TrafficState

Ints = NDArray[np.int32]

LOCK = 4  # cars inside, each in front of the next, that would wait for each other: the cells of a crossing


def labels(env: TrafficJunction, state: TrafficState, *, careful: bool = True) -> Ints:
    """Return what the rule would do (B, N); BRAKE for empty slots."""
    here = env.cell_of(state)
    ahead = intent(env, state)
    last = env.route_cells.shape[1] - 1
    position = np.minimum(state.position, last)
    inside = state.alive & np.isin(here, env.roads.junction_cells)
    rank = (inside * (last + 1) + position) * len(env.routes) + (len(env.routes) - 1 - state.route)
    pair = (ahead >= 0)[:, :, None] & ~np.eye(env.agents, dtype=np.bool_)  # (B, N, N): i's way, j in it
    holds = pair & (ahead[:, :, None] == here[:, None, :])
    yields = pair & (ahead[:, :, None] == ahead[:, None, :]) & (rank[:, None, :] > rank[:, :, None])
    locked = inside & (inside.sum(1, keepdims=True) >= LOCK)
    too_close = holds.any(2) & (position > 0) & ~locked & careful
    moving = state.alive & ~too_close
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
