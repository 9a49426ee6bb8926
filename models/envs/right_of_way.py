"""A central right-of-way rule for Traffic Junction: no two cars that it moves ever meet.

All cars start to move; then, until nothing changes, a car brakes if its next cell is held by a braking car,
or if a car of higher rank enters the same cell. Cars inside a junction rank before those outside, then those
further along their route, then lower slots. Whoever is inside a junction can therefore always leave it, so
traffic never locks.

The rule sees every car, including its route. The only collisions left are those with cars that
appear on an entry cell where somebody waits, or out of a cell that is shared already.
"""

import numpy as np

from models.envs.api import Ints
from models.envs.traffic_junction import BRAKE, GAS, TrafficJunction, TrafficState

_OUT = -1
"""No cell: `next_cell` of a car that would leave."""


def right_of_way(env: TrafficJunction, state: TrafficState) -> Ints:
    """Return the actions (B, N) that the rule gives; BRAKE for empty slots."""
    here = env.cell_of(state)
    ahead = env.next_cell(state)
    first = _ranks_before(env, state, here)  # (B, N, N): the second car ranks before the first
    same = (ahead[:, :, None] == ahead[:, None, :]) & (ahead[:, :, None] != _OUT)
    yields_to = same & first
    blocks = (ahead[:, :, None] == here[:, None, :]) & (ahead[:, :, None] != _OUT)
    blocks &= ~np.eye(env.agents, dtype=np.bool_)
    moving = state.alive
    while True:
        stops = (yields_to & moving[:, None, :]) | (blocks & ~moving[:, None, :])
        still = moving & ~stops.any(2)
        if (still == moving).all():
            return np.where(moving, GAS, BRAKE).astype(np.int32)
        moving = still


def _ranks_before(env: TrafficJunction, state: TrafficState, here: Ints) -> Ints:
    junction = np.isin(here, env.roads.junction_cells)
    longest = env.route_cells.shape[1]
    rank = (junction * longest + state.position) * env.agents + np.arange(env.agents)[::-1]
    return np.asarray(rank[:, None, :] > rank[:, :, None])
