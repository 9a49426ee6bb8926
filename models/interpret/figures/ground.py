"""What lies under a heat map: the roads of Traffic Junction, or a grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from models.envs.traffic_junction import TrafficJunction

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.envs.api import Environment

Box = tuple[int, int, int, int]
"""First column, first row, column and row behind the last."""


class Ground(NamedTuple):
    """The floor of a world."""

    shape: tuple[int, int]
    """(rows, columns)"""
    strips: tuple[Box, ...]
    """What is drawn: each lane in one piece, or each row and each column of a grid."""


def ground(env: Environment[Any]) -> Ground:
    """Return the lanes of a road network; the rows and columns elsewhere."""
    open_cells = np.ones(env.shape, np.bool_)
    if isinstance(env, TrafficJunction):
        open_cells = np.isin(np.arange(env.cells), env.roads.road_cells).reshape(env.shape)
    across = [(first, row, last, row + 1) for row, first, last in _runs(open_cells)]
    down = [(column, first, column + 1, last) for column, first, last in _runs(open_cells.T)]
    return Ground(env.shape, tuple(across + down))


def _runs(cells: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """(line, first, behind the last) of every line that is open from side to side, as each lane is."""
    return [(line, 0, len(row)) for line, row in enumerate(cells) if row.all()]
