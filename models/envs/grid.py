"""A square grid on which seekers look for one sought thing: how they walk, and what a seat sees of it.

What a seat sees is its own (2v+1)x(2v+1) window, row by row; each cell of it is [one-hot of the cell's index,
a spare that is always 0, outside, number of sought there, number of seekers there], dim*dim + 4 numbers. (The
spare keeps the length of the paper's code.) A cell outside the grid has no index.

Shapes: B batch, N seats, P seekers, W window cells, O observation.
"""

from typing import Any

import numpy as np

from models.envs.api import Floats, Ints

UP, RIGHT, DOWN, LEFT, STAY = range(5)
MOVES: tuple[tuple[int, int], ...] = ((-1, 0), (0, 1), (1, 0), (0, -1), (0, 0))
"""(row, column) of each action."""

_MOVES = np.array(MOVES, np.int32)
_OUTSIDE, _SOUGHT, _SEEKERS = 1, 2, 3  # after the dim * dim cell indices


class Grid:
    """A grid of dim x dim cells of which everybody sees `vision` cells to each side."""

    def __init__(self, dim: int, vision: int) -> None:
        self.dim, self.cells = dim, dim * dim
        self.side = 2 * vision + 1
        self.observation_size = self.side**2 * (self.cells + 4)
        reach = np.arange(-vision, vision + 1, dtype=np.int32)
        self._down, self._across = np.repeat(reach, self.side), np.tile(reach, self.side)

    def walk(self, row: Ints, col: Ints, actions: Ints) -> tuple[Ints, Ints]:
        """Return the rows and columns to which actions lead (any shape); walls hold."""
        move = _MOVES[actions]
        last = self.dim - 1
        return np.clip(row + move[..., 0], 0, last), np.clip(col + move[..., 1], 0, last)

    def windows(self, seats: Ints, sought: Ints, seekers: Ints) -> Floats:
        """Return what is seen (B, N, O) from the cells `seats` (B, N), given all `seekers` (B, P)."""
        row = (seats // self.dim)[:, :, None] + self._down  # (B, N, W)
        col = (seats % self.dim)[:, :, None] + self._across
        inside = (row >= 0) & (row < self.dim) & (col >= 0) & (col < self.dim)
        there = np.where(inside, row * self.dim + col, -1)  # where nobody can be
        seen = np.zeros((*there.shape, self.cells + 4), np.float32)
        kind = np.where(inside, there, self.cells + _OUTSIDE)
        np.put_along_axis(seen, kind[..., None], np.float32(1), axis=-1)
        seen[..., self.cells + _SOUGHT] = there == sought[:, None, None]
        seen[..., self.cells + _SEEKERS] = (there[..., None] == seekers[:, None, None]).sum(-1)
        return seen.reshape(*seats.shape, self.observation_size)


def towards(row: Any, col: Any, to_row: Any, to_col: Any) -> Ints:
    """Return the action of a shortest walk, rows first; STAY on arrival."""
    ways = [to_row < row, to_row > row, to_col < col, to_col > col]
    return np.select(ways, [UP, DOWN, LEFT, RIGHT], STAY).astype(np.int32)
