"""What lies under a heat map: the roads of Traffic Junction, or a grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from models.envs.traffic_junction import TrafficJunction

if TYPE_CHECKING:
    from models.envs.api import Environment

Box = tuple[int, int, int, int]
"""First column, first row, column and row behind the last."""


class Ground(NamedTuple):
    """The floor of a world."""

    shape: tuple[int, int]
    """(rows, columns)"""
    strips: tuple[Box, ...]
    """What is drawn: each lane in one piece, or each cell of a grid."""


def ground(env: Environment[Any]) -> Ground:
    """Return the lanes of a road network, which cross the whole grid; the cells elsewhere."""
    rows, columns = env.shape
    if not isinstance(env, TrafficJunction):
        return Ground(env.shape, tuple((x, y, x + 1, y + 1) for y in range(rows) for x in range(columns)))
    road = np.isin(np.arange(env.cells), env.roads.road_cells).reshape(env.shape)
    across = [(0, int(row), columns, int(row) + 1) for row in np.flatnonzero(road.all(axis=1))]
    down = [(int(column), 0, int(column) + 1, rows) for column in np.flatnonzero(road.all(axis=0))]
    return Ground(env.shape, tuple(across + down))
