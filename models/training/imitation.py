"""Labels for the warm start: what a rule that sees the whole state would do where the learner is.

The learner sees only its own part and hears the others, visits its own states and is told there what the rule
would do. Messages are learned through the listeners' gradient. Nobody is ever served the rule.

Predator-Prey: straight to the prey, rows first, so that whoever knows the place knows the label.

Traffic Junction: front car first, careful or not. A car brakes if a car of higher rank enters the same cell,
or if its next cell is held by a car that brakes. Rank: inside a junction first, then further along the route,
then the lower route. Where people drive too, the rule is careful: a car brakes if its next cell is taken at
all, even if that car will probably leave it, since people brake when they like, and whoever follows too
closely hits them. Two exceptions: on the entry cell, where another car may appear on it, and while the
junction is full, which would lock.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.envs.api import Environment
from models.envs.traffic_junction import BRAKE, GAS, TrafficJunction, TrafficState
from models.policies.scripted import Straight

Ints = NDArray[np.int32]

LOCK = 4  # cars inside, each in front of the next, that would wait for each other: the cells of a crossing


def labels(env: Environment[Any], state: Any, *, careful: bool = True) -> Ints:
    """Return what the rule of this world would do (B, N); ``careful`` is for Traffic Junction.

    Raises:
        KeyError: it has none, see `has_rule`.
    """
    return _RULES[_family(env.name)](env, state, careful)


def has_rule(task: str) -> bool:
    """Return whether there is a rule to imitate in this task."""
    return _family(task) in _RULES


def _family(task: str) -> str:
    return task.partition("/")[0]


def _front_car_first(env: TrafficJunction, state: TrafficState, careful: bool) -> Ints:
    """Return GAS or BRAKE for each car; BRAKE for empty slots."""
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


def _straight(env: Environment[Any], state: Any, _careful: bool) -> Ints:
    return Straight().actions(env, state)


_RULES: dict[str, Callable[[Any, Any, bool], Ints]] = {
    "traffic_junction": _front_car_first,
    "predator_prey": _straight,
}
