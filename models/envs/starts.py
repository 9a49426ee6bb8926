"""How a human trial of Traffic Junction begins: 5 to 9 cars already drive, and the participant joins them.

The start is a pure function of the situation's seed, shared by training, evaluation and server. In a world
of its own (attempt 0) k is drawn uniformly from 5-9 and the participant's route uniformly from all routes.
The participant has the last slot, which stays empty while cars arrive (p = .2 at each entrance) up to k,
moved by the right-of-way rule. At the first step >= 12 with exactly k cars, no shared cell and a free entry
cell the participant appears at position 0. If that has not happened after 200 steps, all is drawn again as
the next attempt.

From then on cars arrive with probability `arrival`, never in the participant's own cell; collisions count
from the participant's first state, and the episode lasts `steps_max` more steps.
"""

from dataclasses import dataclass, replace

import numpy as np

from models import rng
from models.envs.api import Bools, Ints, Seeds, put, take
from models.envs.right_of_way import right_of_way
from models.envs.traffic_junction import BRAKE, NEVER, TrafficJunction, TrafficState, with_arrival

CARS = (5, 9)
"""Fewest and most cars that the participant meets."""
WARMUP_MIN, WARMUP_MAX = 12, 200
WARMUP_ARRIVAL = 0.2
ARRIVAL = 0.05

ATTEMPTS = 3
"""Stream over (situation seed, attempt): index 0 the seed of the world, 1 the number of cars, 2 the route."""


@dataclass(frozen=True, slots=True)
class HumanStart:
    """Where B human trials begin and how they came to that."""

    state: TrafficState
    """As the participant appears, in the last slot."""
    warmup: tuple[tuple[TrafficState, Ints], ...]
    """The states before and the actions (B, N) taken in them. Episodes that are through their warm-up repeat
    the state in which the participant appears, with BRAKE."""
    length: Ints
    """(B,) steps of each warm-up."""
    cars: Ints
    """(B,) other cars driving when the participant appears."""

    def active(self, step: int) -> Bools:
        """Return which episodes (B,) are still in their warm-up at `warmup[step]`."""
        return np.asarray(step < self.length)


@dataclass(frozen=True, slots=True)
class _Draw:
    """One attempt of each episode."""

    seed: Seeds
    cars: Ints
    route: Ints


def has_room(env: TrafficJunction) -> bool:
    """Return whether there are slots for the most cars and a participant."""
    return env.agents > CARS[1]


def human_start(env: TrafficJunction, seeds: Seeds, arrival: float = ARRIVAL) -> HumanStart:
    """Return the starts of human trials for these situation seeds (B,).

    Each depends on its own seed only. `arrival` is the probability per entrance and step from the start on.

    Raises:
        ValueError: the environment has too few slots for so many cars and a participant.
    """
    if not has_room(env):
        raise ValueError(f"a human trial needs {CARS[1] + 1} slots, {env.name} has {env.agents}")
    seeds = np.asarray(seeds, np.uint64)
    attempt = np.zeros(len(seeds), np.int32)
    while True:
        begun, late = _warm_up(env, _draw(env, seeds, attempt), arrival)
        if not late.any():
            return begun
        attempt += late


def _warm_up(env: TrafficJunction, draw: _Draw, arrival: float) -> tuple[HumanStart, Bools]:
    """Return the starts that these draws lead to, and which of them (B,) did not come about in time."""
    state = _begin(env, draw)
    length = np.zeros(len(draw.seed), np.int32)
    waiting = np.arange(len(draw.seed))
    warmup: list[tuple[TrafficState, Ints]] = []
    while True:
        if len(warmup) >= WARMUP_MIN:
            ready = _ready(env, take(state, waiting), take(draw, waiting))
            entering, waiting = waiting[ready], waiting[~ready]
            length[entering] = len(warmup)
            state = put(state, entering, _entered(env, take(state, entering), take(draw, entering), arrival))
        if not waiting.size or len(warmup) == WARMUP_MAX:
            late = np.isin(np.arange(len(length)), waiting)
            return HumanStart(state, tuple(warmup), length, draw.cars), late
        part = take(state, waiting)
        actions = np.full(state.route.shape, BRAKE, np.int32)
        actions[waiting] = right_of_way(env, part)
        warmup.append((state, actions))
        state = put(state, waiting, env.step(part, actions[waiting])[0])


def _draw(env: TrafficJunction, seeds: Seeds, attempt: Ints) -> _Draw:
    word = rng.words(seeds[:, None], ATTEMPTS, attempt[:, None], np.arange(3))
    fewest, most = CARS
    return _Draw(
        seed=word[:, 0],
        cars=(fewest + rng.below(word[:, 1], most - fewest + 1)).astype(np.int32),
        route=rng.below(word[:, 2], len(env.routes)).astype(np.int32),
    )


def _begin(env: TrafficJunction, draw: _Draw) -> TrafficState:
    empty = with_arrival(env.init(draw.seed), WARMUP_ARRIVAL)
    return replace(
        empty,
        end=np.full_like(empty.end, NEVER),
        cars_max=draw.cars,
        guest=np.full_like(empty.guest, env.agents - 1),
    )


def _ready(env: TrafficJunction, state: TrafficState, draw: _Draw) -> Bools:
    """Return where the participant can appear (B,), if the warm-up is long enough."""
    entry = env.route_cells[draw.route, 0]
    free = (env.cell_of(state) != entry[:, None]).all(1)
    apart = ~env.collided(state).any(1)
    full = state.alive.sum(1) == draw.cars
    return np.asarray(full & apart & free)


def _entered(env: TrafficJunction, state: TrafficState, draw: _Draw, arrival: float) -> TrafficState:
    """Return the states with the participant in the last slot."""
    last = np.zeros(env.agents, np.bool_)
    last[-1] = True
    joined = replace(
        state,
        end=state.t + np.int32(env.steps_max),
        alive=state.alive | last,
        fresh=state.fresh | last,
        route=np.where(last, draw.route[:, None], state.route),
        collided_ever=np.zeros_like(state.collided_ever),
        crashed=np.zeros_like(state.crashed),
        cars_max=np.full_like(state.cars_max, env.agents),
    )
    return with_arrival(joined, arrival)
