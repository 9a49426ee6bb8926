"""Predator-Prey: predators look for one prey that never moves, and stay with it; everybody talks.

Seats 0 to N-1 are the predators: each moves up, right, down, left or stays; a move into the wall leaves it
where it is, and a predator that has reached the prey stays there whatever it does. The last seat is the prey:
its action is ignored. All begin on distinct uniformly drawn cells, and every seat may speak at every step.
Cells can be shared.

Each step pays a predator -0.05 off the prey and +0.05 k on it, with k predators there after the move. The
prey is paid the predators' mean: all want the same. (The paper's code pays it for not being found.) Episodes
run all `steps_max` steps; success is that all predators are on the prey now.

An observation is the own window, see `models.envs.grid`: the prey is what is sought, the predators seek.

Source: Karten et al. 2023, section on Predator-Prey; rules as in Singh, Jain, Sukhbaatar 2018 (IC3Net).
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from models import rng
from models.envs.api import Bools, Floats, Ints, Seeds, where
from models.envs.grid import STAY, Grid

Size = Literal["5x5", "10x10"]

PLACES = 4
"""Stream of the first cells: index i is the seat, which gets one of the cells that are left."""

_SIZES: dict[Size, tuple[int, int, int, int]] = {  # cells to a side, predators, vision, steps
    "5x5": (5, 3, 0, 20),
    "10x10": (10, 5, 1, 40),
}
_PAY = 5  # hundredths of reward


@dataclass(frozen=True, slots=True)
class PredatorPreyState:
    """Everything about B hunts with P predators."""

    seed: Seeds
    """(B,)"""
    t: Ints
    """(B,) steps since `init`."""
    predator: Ints
    """(B, P) cell of each predator."""
    prey: Ints
    """(B,) cell of the prey."""


class PredatorPrey:
    """Predator-Prey of one size; see the module docstring for the rules."""

    version = 1
    actions = STAY + 1
    message_held = False

    def __init__(self, size: Size) -> None:
        self.name = f"predator_prey/{size}"
        self.dim, self.predators, self.vision, self.steps_max = _SIZES[size]
        self.agents = self.predators + 1
        self.sought: int | None = self.predators
        self.shape = (self.dim, self.dim)
        self.cells = self.dim * self.dim
        self.speaks: Bools = np.ones(self.agents, np.bool_)
        self._grid = Grid(self.dim, self.vision)
        self.observation_size = self._grid.observation_size

    def init(self, seeds: Seeds) -> PredatorPreyState:
        seed = np.array(seeds, np.uint64)
        draws = rng.words(seed[:, None], PLACES, 0, np.arange(self.agents))
        free = np.ones((len(seed), self.cells), np.bool_)
        cell = np.zeros((len(seed), self.agents), np.int32)
        for seat in range(self.agents):
            nth = rng.below(draws[:, seat], self.cells - seat)
            cell[:, seat] = (free.cumsum(1) > nth[:, None]).argmax(1)
            free[np.arange(len(seed)), cell[:, seat]] = False
        return self.place(seed, cell[:, :-1], cell[:, -1])

    def place(self, seeds: Seeds, predator: Ints, prey: Ints) -> PredatorPreyState:
        """Return hunts that begin with the predators (B, P) and the prey (B,) on these cells."""
        return PredatorPreyState(
            seed=np.array(seeds, np.uint64),
            t=np.zeros(len(seeds), np.int32),
            predator=np.array(predator, np.int32),
            prey=np.array(prey, np.int32),
        )

    def step(self, state: PredatorPreyState, actions: Ints) -> tuple[PredatorPreyState, Floats]:
        row, col = divmod(state.predator, np.int32(self.dim))
        row, col = self._grid.walk(row, col, actions[:, : self.predators])
        predator = np.where(self.reached(state), state.predator, row * self.dim + col)
        after = replace(state, t=state.t + np.int32(1), predator=predator.astype(np.int32))
        over = self.done(state)
        return where(over, state, after), np.where(over[:, None], np.float32(0), self._pay(after))

    def observe(self, state: PredatorPreyState) -> Floats:
        return self._grid.windows(self.cell_of(state), state.prey, state.predator)

    def alive(self, state: PredatorPreyState) -> Bools:
        return np.ones((len(state.t), self.agents), np.bool_)

    def fresh(self, state: PredatorPreyState) -> Bools:
        return np.repeat(state.t[:, None] == 0, self.agents, axis=1)

    def cell_of(self, state: PredatorPreyState) -> Ints:
        return np.concatenate([state.predator, state.prey[:, None]], axis=1)

    def done(self, state: PredatorPreyState) -> Bools:
        return np.asarray(state.t >= self.steps_max)

    def success(self, state: PredatorPreyState) -> Bools:
        return np.asarray(self.reached(state).all(1))

    def reached(self, state: PredatorPreyState) -> Bools:
        """Return which predators (B, P) are on the prey."""
        return np.equal(state.predator, state.prey[:, None])

    def _pay(self, state: PredatorPreyState) -> Floats:
        """Return what this state pays (B, N)."""
        there = self.reached(state)
        hundredths = np.where(there, _PAY * there.sum(1, keepdims=True), -_PAY)
        mean = hundredths.sum(1, keepdims=True) / self.predators
        return (np.concatenate([hundredths, mean], axis=1) / 100).astype(np.float32)
