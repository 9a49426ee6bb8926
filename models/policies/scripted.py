"""Rule-based drivers and seekers: baselines, teammates in practice rounds, doubles for tests.

Nothing is learned. A scripted policy sees the whole state and says nothing. It holds no memory, so that its
action in a state is always the same.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from models import rng
from models.envs.api import Environment, Ints
from models.envs.grid import MOVES, STAY, towards
from models.envs.parent_child import ParentChild, ParentChildState
from models.envs.predator_prey import PredatorPrey
from models.envs.right_of_way import right_of_way
from models.envs.traffic_junction import GAS, TrafficJunction

RANDOM_ACTIONS = 16
"""Stream over the random policy's own seed; the word is its stream in each world, where index is the seat."""


class Scripted(Protocol):
    """A policy that is a rule."""

    name: str

    def actions(self, env: Environment[Any], state: Any) -> Ints:
        """Return the actions of all seats (B, N).

        Raises:
            WrongTaskError: the rule is made for another task.
        """
        ...


class UnknownScriptedError(KeyError):
    """No scripted policy has this name."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.name = name

    def __str__(self) -> str:
        return f"unknown scripted policy {self.name!r}; known ones: {', '.join(NAMES)}"


class WrongTaskError(ValueError):
    """A rule was asked to play a task for which it is not made."""


class AlwaysGas:
    """Every car drives on; the policy that training falls into when it does not learn to listen."""

    name = "scripted:always-gas"

    def actions(self, env: Environment[Any], state: Any) -> Ints:
        _crossing(env, self.name)
        return np.full((len(state.t), env.agents), GAS, np.int32)


class Random:
    """Every action equally likely, drawn from the counter of the world's seed, the step and the seat."""

    name = "scripted:random"

    def __init__(self, seed: int = 0) -> None:
        self._stream = rng.word(seed, RANDOM_ACTIONS, 0, 0)

    def actions(self, env: Environment[Any], state: Any) -> Ints:
        draws = rng.words(state.seed[:, None], self._stream, state.t[:, None], np.arange(env.agents))
        return rng.below(draws, env.actions).astype(np.int32)


class FrontCarFirst:
    """The central right-of-way rule that sees every car: what perfect communication could reach."""

    name = "scripted:front-car-first"

    def actions(self, env: Environment[Any], state: Any) -> Ints:
        return right_of_way(_crossing(env, self.name), state)


class Seeker:
    """A parent that hears nothing: it goes round a fixed tour and walks to the child once it is in view."""

    name = "scripted:seeker"

    def actions(self, env: Environment[Any], state: Any) -> Ints:
        search = _search(env, self.name)
        in_view = np.maximum(*_distance(state)) <= search.vision
        tour = _TOUR[state.parent_row, state.parent_col]
        return _with_child(np.where(in_view, _towards_child(state), tour))


class Oracle:
    """A parent that knows where the child is: the floor of steps for any agent."""

    name = "scripted:oracle"

    def actions(self, env: Environment[Any], state: Any) -> Ints:
        _search(env, self.name)
        return _with_child(_towards_child(state))


class Straight:
    """Predators that know where the prey is and walk straight to it, rows first: the ceiling."""

    name = "scripted:straight"

    def actions(self, env: Environment[Any], state: Any) -> Ints:
        hunt = _hunt(env, self.name)
        cell = hunt.cell_of(state)
        return towards(*divmod(cell, hunt.dim), *divmod(state.prey[:, None], hunt.dim))


class StraightLate:
    """The same from the second step on: the ceiling where messages arrive one step late."""

    name = "scripted:straight-late"

    def actions(self, env: Environment[Any], state: Any) -> Ints:
        _hunt(env, self.name)
        return np.where(state.t[:, None] == 0, np.int32(STAY), Straight().actions(env, state))


_POLICIES: dict[str, Callable[[], Scripted]] = {
    AlwaysGas.name: AlwaysGas,
    Random.name: Random,
    FrontCarFirst.name: FrontCarFirst,
    Seeker.name: Seeker,
    Oracle.name: Oracle,
    Straight.name: Straight,
    StraightLate.name: StraightLate,
}

NAMES: tuple[str, ...] = tuple(_POLICIES)


def make(name: str) -> Scripted:
    """Return the scripted policy of this name, such as `scripted:random`.

    Raises:
        UnknownScriptedError: the name is not in `NAMES`.
    """
    if name not in _POLICIES:
        raise UnknownScriptedError(name)
    return _POLICIES[name]()


def _crossing(env: Environment[Any], name: str) -> TrafficJunction:
    if not isinstance(env, TrafficJunction):
        raise WrongTaskError(f"{name} drives in traffic_junction, it cannot play {env.name}")
    return env


def _search(env: Environment[Any], name: str) -> ParentChild:
    if not isinstance(env, ParentChild):
        raise WrongTaskError(f"{name} searches in parent_child, it cannot play {env.name}")
    return env


def _hunt(env: Environment[Any], name: str) -> PredatorPrey:
    if not isinstance(env, PredatorPrey):
        raise WrongTaskError(f"{name} hunts in predator_prey, it cannot play {env.name}")
    return env


def _distance(state: ParentChildState) -> tuple[Ints, Ints]:
    return np.abs(state.child_row - state.parent_row), np.abs(state.child_col - state.parent_col)


def _towards_child(state: ParentChildState) -> Ints:
    return towards(state.parent_row, state.parent_col, state.child_row, state.child_col)


def _with_child(parent: Ints) -> Ints:
    """Return (B, 2) actions from the parent's (B,); the child stays."""
    return np.stack([parent, np.full_like(parent, STAY)], axis=1).astype(np.int32)


def _tour() -> NDArray[np.int32]:
    """Return the seeker's action on every cell (9, 9).

    The tour is a closed loop of 30 cells whose 3x3 windows together cover the grid: the square one cell
    inside the border, with a dent from its left side to the centre. Off the loop the parent walks to the
    nearest cell of it.
    """
    corners = [(1, 1), (1, 7), (7, 7), (7, 1), (5, 1), (5, 4), (4, 4), (4, 1), (1, 1)]
    loop = {}
    for begin, end in pairwise(corners):
        cell = begin
        while cell != end:
            step = int(towards(*cell, *end))
            loop[cell] = step
            cell = cell[0] + MOVES[step][0], cell[1] + MOVES[step][1]
    tour = np.zeros((ParentChild.dim, ParentChild.dim), np.int32)
    for row, col in np.ndindex(ParentChild.dim, ParentChild.dim):
        nearest = min(loop, key=lambda cell: abs(cell[0] - row) + abs(cell[1] - col))
        tour[row, col] = loop.get((row, col), towards(row, col, *nearest))
    return tour


_TOUR = _tour()
