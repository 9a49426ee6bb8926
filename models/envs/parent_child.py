"""Parent & Lost Child: a parent searches a 9x9 grid for a child that stays where it is and talks.

Seat 0 is the parent: it moves up, right, down, left or stays; a move into the wall leaves it where it is.
Seat 1 is the child: it never moves, its action is ignored, and only it may speak; what it says first is heard
at every step. The two begin on distinct uniformly drawn cells. An episode ends when the parent stands on the
child, or after 20 steps. Each step pays both seats 0.05, and -0.05 as long as the child is not found.

An observation is the own 3x3 window, see `models.envs.grid`: the child is sought, the parent seeks.

Source: Karten et al. 2023, human experiment 1: Predator-Prey with one predator and one talking prey.
"""

from dataclasses import dataclass, replace

import numpy as np

from models import rng
from models.envs.api import Bools, Floats, Ints, Seeds, where
from models.envs.grid import STAY, Grid

PARENT, CHILD = 0, 1

PLACES = 2
"""Stream of the first cells: index 0 the parent, 1 the child among the cells that are left."""


@dataclass(frozen=True, slots=True)
class ParentChildState:
    """Everything about B searches; every field has the shape (B,)."""

    seed: Seeds
    t: Ints
    """Steps that the parent has made."""
    parent_row: Ints
    parent_col: Ints
    child_row: Ints
    child_col: Ints
    found: Bools


class ParentChild:
    """Parent & Lost Child; see the module docstring for the rules."""

    name = "parent_child"
    version = 1
    agents = 2
    actions = STAY + 1
    steps_max = 20
    dim = 9
    vision = 1
    message_held = True
    sought: int | None = CHILD

    def __init__(self) -> None:
        self.shape = (self.dim, self.dim)
        self.cells = self.dim * self.dim
        self.speaks: Bools = np.array([False, True])
        self._grid = Grid(self.dim, self.vision)
        self.observation_size = self._grid.observation_size

    def init(self, seeds: Seeds) -> ParentChildState:
        seed = np.array(seeds, np.uint64)
        draws = rng.words(seed[:, None], PLACES, 0, np.arange(2))
        parent = rng.below(draws[:, 0], self.cells).astype(np.int32)
        child = rng.below(draws[:, 1], self.cells - 1).astype(np.int32)
        child += child >= parent  # the parent's own cell is left out
        return self.place(seed, parent, child)

    def place(self, seeds: Seeds, parent: Ints, child: Ints) -> ParentChildState:
        """Return searches that begin on these cells (B,), for interpretation and tests."""
        return ParentChildState(
            seed=np.array(seeds, np.uint64),
            t=np.zeros(len(seeds), np.int32),
            parent_row=(parent // self.dim).astype(np.int32),
            parent_col=(parent % self.dim).astype(np.int32),
            child_row=(child // self.dim).astype(np.int32),
            child_col=(child % self.dim).astype(np.int32),
            found=np.asarray(parent == child),
        )

    def step(self, state: ParentChildState, actions: Ints) -> tuple[ParentChildState, Floats]:
        row, col = self._grid.walk(state.parent_row, state.parent_col, actions[:, PARENT])
        found = (row == state.child_row) & (col == state.child_col)
        after = replace(state, t=state.t + np.int32(1), parent_row=row, parent_col=col, found=found)
        over = self.done(state)
        hundredths = np.where(over, 0, np.where(found, 5, -5))
        reward = hundredths.astype(np.float32) / np.float32(100)
        return where(over, state, after), np.repeat(reward[:, None], self.agents, axis=1)

    def observe(self, state: ParentChildState) -> Floats:
        cell = self.cell_of(state)
        return self._grid.windows(cell, cell[:, CHILD], cell[:, [PARENT]])

    def alive(self, state: ParentChildState) -> Bools:
        return np.ones((len(state.t), self.agents), np.bool_)

    def fresh(self, state: ParentChildState) -> Bools:
        return np.equal(self._pair(state.t, state.t), 0)

    def cell_of(self, state: ParentChildState) -> Ints:
        parent = state.parent_row * self.dim + state.parent_col
        return self._pair(parent, state.child_row * self.dim + state.child_col)

    def done(self, state: ParentChildState) -> Bools:
        return state.found | (state.t >= self.steps_max)

    def success(self, state: ParentChildState) -> Bools:
        return state.found

    def steps(self, state: ParentChildState) -> Ints:
        """Return the parent's steps so far (B,); once done this is 20 if the child was not found."""
        return state.t

    def _pair(self, parent: Ints, child: Ints) -> Ints:
        return np.stack([parent, child], axis=1).astype(np.int32, copy=False)
