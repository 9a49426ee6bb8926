"""Traffic Junction: cars on fixed routes that choose only between gas and brake, blind to each other.

A step of the world, in this order:

1. every car acts: gas advances it one cell along its route, past the last cell it leaves; nothing blocks
   movement;
2. for each entrance in order, unless the slots are full: with probability p a car appears at position 0, in a
   uniformly chosen empty slot, on a uniformly chosen route of that entrance; the entry cell is not checked;
3. every car pays 0.01 per step since it appeared, and 10 if another car is in its cell. Crashed cars stay.

Two cars may share a cell; changing places is no collision. Episodes run `steps_max` steps; success is that no
car ever shared a cell. `init` puts no car in.

An observation is [last action, route id / (routes - 1), one-hot of the own cell among the road cells, number
of cars in the own cell, the own one counted].

Two fields serve human trials (`models.envs.starts`): `cars_max` stops arrivals early, and `guest` is a slot
kept for a participant: no other car gets it, and no car arrives in the cell where the guest is.

Source: Karten et al. 2023, section on Traffic Junction; rules as in Singh, Jain, Sukhbaatar 2018 (IC3Net).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models import rng
from models.envs import roads
from models.envs.api import Bools, Floats, Ints, Seeds, where

GAS, BRAKE = 0, 1
NO_GUEST = -1
NEVER = np.iinfo(np.int32).max
"""An `end` that is never reached."""

ARRIVALS = 1
"""Stream of step 2: index 3 * entrance + 0 whether a car appears, + 1 its slot, + 2 its route."""

_CRASH, _WAIT = 1000, 1  # hundredths of reward

_SIZES: dict[roads.Size, tuple[int, int, float]] = {  # cars, steps, arrival probability (hard: .02-.05)
    "easy": (5, 20, 0.1),
    "medium": (10, 40, 0.05),
    "hard": (20, 80, 0.05),
}


@dataclass(frozen=True, slots=True)
class TrafficState:
    """Everything about B crossings with N slots. Empty slots hold zeros."""

    seed: Seeds
    """(B,) of the world's own draws."""
    t: Ints
    """(B,) steps since `init`."""
    end: Ints
    """(B,) the t at which the episode is over."""
    alive: Bools
    """(B, N) a car has this slot."""
    fresh: Bools
    """(B, N) ... since this state."""
    completed: Bools
    """(B, N) the slot's former car arrived at the end of its route in the last step."""
    route: Ints
    """(B, N) route id."""
    position: Ints
    """(B, N) index along the route."""
    age: Ints
    """(B, N) steps since the car appeared."""
    last_action: Ints
    """(B, N) 0 for a car that has not acted yet."""
    collided_ever: Bools
    """(B, N) this car has shared a cell before or does now."""
    crashed: Bools
    """(B,) any car has shared a cell in this episode."""
    arrival_threshold: NDArray[np.int64]
    """(B,) `rng.threshold` of the arrival probability."""
    cars_max: Ints
    """(B,) no car arrives while so many drive."""
    guest: Ints
    """(B,) slot reserved for a participant, or -1."""


class TrafficJunction:
    """Traffic Junction of one size; see the module docstring for the rules."""

    version = 1
    actions = 2
    message_held = False
    sought: int | None = None

    def __init__(self, size: roads.Size) -> None:
        plan = roads.PLANS[size]
        self.name = f"traffic_junction/{size}"
        self.agents, self.steps_max, self.arrival = _SIZES[size]
        self.shape = (plan.side, plan.side)
        self.cells = plan.side * plan.side
        self.speaks: Bools = np.ones(self.agents, np.bool_)
        self.roads = roads.build(plan)
        self.routes = self.roads.routes
        self.route_cells = self.roads.route_cells
        self.route_length = self.roads.route_length
        self.entry_cells = self.roads.entry_cells
        self.routes_per_entrance = len(self.routes) // len(self.entry_cells)
        self.observation_size = len(self.roads.road_cells) + 3
        self._column = np.full(self.cells, -1, np.int64)  # of a road cell in the observation
        self._column[self.roads.road_cells] = np.arange(len(self.roads.road_cells)) + 2
        self._draws = np.arange(3 * len(self.entry_cells)).reshape(-1, 3)

    def init(self, seeds: Seeds) -> TrafficState:
        """Return empty crossings with the size's own arrival probability."""
        batch = len(seeds)
        grid = (batch, self.agents)
        return TrafficState(
            seed=np.array(seeds, np.uint64),
            t=np.zeros(batch, np.int32),
            end=np.full(batch, self.steps_max, np.int32),
            alive=np.zeros(grid, np.bool_),
            fresh=np.zeros(grid, np.bool_),
            completed=np.zeros(grid, np.bool_),
            route=np.zeros(grid, np.int32),
            position=np.zeros(grid, np.int32),
            age=np.zeros(grid, np.int32),
            last_action=np.zeros(grid, np.int32),
            collided_ever=np.zeros(grid, np.bool_),
            crashed=np.zeros(batch, np.bool_),
            arrival_threshold=np.full(batch, rng.threshold(self.arrival), np.int64),
            cars_max=np.full(batch, self.agents, np.int32),
            guest=np.full(batch, NO_GUEST, np.int32),
        )

    def step(self, state: TrafficState, actions: Ints) -> tuple[TrafficState, Floats]:
        moved = self._arrive(self._move(state, actions))
        crowded = self.crowd(moved) > 1
        after = replace(
            moved,
            collided_ever=(moved.collided_ever & moved.alive & ~moved.fresh) | crowded,
            crashed=moved.crashed | crowded.any(1),
        )
        hundredths = -(_WAIT * after.age + _CRASH * crowded)
        reward = hundredths.astype(np.float32) / np.float32(100)
        over = self.done(state)
        if over.any():
            return where(over, state, after), np.where(over[:, None], np.float32(0), reward)
        return after, reward

    def observe(self, state: TrafficState) -> Floats:
        seen = np.zeros((*state.alive.shape, self.observation_size), np.float32)
        row, slot = np.nonzero(state.alive)
        route = state.route[row, slot]
        seen[row, slot, 0] = state.last_action[row, slot]
        seen[row, slot, 1] = route.astype(np.float32) / np.float32(len(self.routes) - 1)
        seen[row, slot, self._column[self.route_cells[route, state.position[row, slot]]]] = 1
        seen[row, slot, -1] = self.crowd(state)[row, slot]
        return seen

    def alive(self, state: TrafficState) -> Bools:
        return state.alive

    def fresh(self, state: TrafficState) -> Bools:
        return state.fresh

    def cell_of(self, state: TrafficState) -> Ints:
        return np.where(state.alive, self.route_cells[state.route, state.position], np.int32(-1))

    def done(self, state: TrafficState) -> Bools:
        return state.t >= state.end

    def success(self, state: TrafficState) -> Bools:
        return ~state.crashed

    def next_cell(self, state: TrafficState) -> Ints:
        """Return the cell that gas would lead to (B, N); -1 where it leads out, and for empty slots."""
        position = state.position + 1
        stays = state.alive & (position < self.route_length[state.route])
        last = self.route_cells.shape[1] - 1
        return np.where(stays, self.route_cells[state.route, np.minimum(position, last)], np.int32(-1))

    def completed(self, state: TrafficState) -> Bools:
        """Return whose car arrived at the end of its route in the last step (B, N)."""
        return state.completed

    def collided(self, state: TrafficState) -> Bools:
        """Return which cars share their cell now (B, N)."""
        return self.crowd(state) > 1

    def crowd(self, state: TrafficState) -> Ints:
        """Return how many cars are in each car's cell, itself counted (B, N); 0 for empty slots."""
        row, slot = np.nonzero(state.alive)
        place = row * self.cells + self.route_cells[state.route[row, slot], state.position[row, slot]]
        count = np.zeros(state.alive.shape, np.int32)
        count[row, slot] = np.bincount(place, minlength=1)[place]
        return count

    def _move(self, state: TrafficState, actions: Ints) -> TrafficState:
        position = state.position + (actions == GAS)
        leaves = state.alive & (position >= self.route_length[state.route])
        stays = state.alive & ~leaves
        return replace(
            state,
            t=state.t + np.int32(1),
            alive=stays,
            completed=leaves,
            route=state.route * stays,
            position=(position * stays).astype(np.int32),
            age=(state.age + np.int32(1)) * stays,
            last_action=(actions * stays).astype(np.int32),
        )

    def _arrive(self, state: TrafficState) -> TrafficState:
        """Put new cars in, entrance by entrance; draws belong to the step that led to `state.t`."""
        draws = rng.words(state.seed[:, None, None], ARRIVALS, state.t[:, None, None], self._draws)
        wanted = rng.chance(draws[:, :, 0], state.arrival_threshold[:, None])
        wanted &= self._guest_cell(state)[:, None] != self.entry_cells
        alive, route = state.alive.copy(), state.route.copy()
        for entrance in np.flatnonzero(wanted.any(0)):
            row = np.flatnonzero(wanted[:, entrance])
            empty = ~alive[row]
            empty &= np.arange(self.agents) != state.guest[row, None]
            choices = empty.sum(1)
            room = (choices > 0) & (alive[row].sum(1) < state.cars_max[row])
            nth = rng.below(draws[row, entrance, 1], choices)
            slot = (empty.cumsum(1) > nth[:, None]).argmax(1)[room]
            row = row[room]
            alive[row, slot] = True
            turn = rng.below(draws[row, entrance, 2], self.routes_per_entrance)
            route[row, slot] = entrance * self.routes_per_entrance + turn
        return replace(state, alive=alive, route=route, fresh=alive & ~state.alive)

    def _guest_cell(self, state: TrafficState) -> Ints:
        """Return the cell of the guest (B,), -1 where none drives."""
        every = np.arange(len(state.guest))
        cell = self.cell_of(state)[every, state.guest]
        return np.where(state.guest == NO_GUEST, np.int32(-1), cell)


def with_arrival(state: TrafficState, p: ArrayLike) -> TrafficState:
    """Return the state with another arrival probability from now on: one number or one per episode (B,).

    Raises:
        ValueError: p is not a probability.
    """
    each = np.broadcast_to(np.asarray(p, np.float64), state.arrival_threshold.shape)
    if not ((each >= 0) & (each <= 1)).all():
        raise ValueError(f"an arrival probability lies between 0 and 1, not {p!r}")
    return replace(state, arrival_threshold=(each * 2**32).astype(np.int64))
