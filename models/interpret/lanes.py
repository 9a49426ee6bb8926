"""On which lane a car is: the one in whose direction it moves next (at the end of its route: moved last).

A car that turns changes its lane in the junction cell where it turns.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.envs.traffic_junction import TrafficJunction

HEADINGS = {(1, 0): "down", (-1, 0): "up", (0, 1): "right", (0, -1): "left"}


class Lanes(NamedTuple):
    """All lanes of a road network."""

    names: tuple[str, ...]
    """Such as "down, column 6"."""
    of: NDArray[np.int64]
    """(R, L) index of the lane of a car on each route at each position; padding repeats the last one."""


def lanes(env: TrafficJunction) -> Lanes:
    """Return the lanes of a world, and which one each place on each route belongs to."""
    named = [_along(route, env.shape[1]) for route in env.routes]
    names = tuple(sorted({name for way in named for name in way}))
    longest = env.route_cells.shape[1]
    of = [[names.index(name) for name in way + way[-1:] * (longest - len(way))] for way in named]
    return Lanes(names, np.array(of, np.int64))


def _along(route: tuple[int, ...], columns: int) -> list[str]:
    """Name the lane of each place of a route."""
    cells = [divmod(cell, columns) for cell in route]
    moves = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(cells)]
    return [
        f"{HEADINGS[move]}, {'column' if move[0] else 'row'} {column if move[0] else row}"
        for (row, column), move in zip(cells, [*moves, moves[-1]], strict=True)
    ]
