"""Road networks of Traffic Junction: lanes, arrival points and the routes that cars may drive.

Lanes are one cell wide and cross the whole grid. Traffic keeps right: of the two rows of a horizontal road
the upper one leads left and the lower one right; of the two columns of a vertical road the left one leads
down and the right one up.

Arrival points stand in the order top, bottom, left, right, and on one side by growing row or column. From
each, a car may leave by every lane that ends at the border, except the other lane of its own road (no
U-turn), by a path of at most `turns_max` turns. Of several paths to one exit the shortest counts; then the
one with fewer turns; then the one that turns first. Routes of one arrival are ordered by number of turns,
then right before left at the first turn (then at the second), then by length. This gives

- easy: 2 routes (no turns, one-way lanes);
- medium: 4 arrivals of 3 routes, straight, right, left;
- hard: 8 arrivals of 7 routes: straight on; right and left, each onto either of two roads; and the two
  exits of the parallel road, which need two turns. Roads lie on rows and columns 4-5 and 12-13, which leaves
  4, 6 and 4 cells between them and the border (a choice of this project; the paper gives only the number of
  roads and routes).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from models.envs.api import Ints

Size = Literal["easy", "medium", "hard"]
Cell = tuple[int, int]
Heading = tuple[int, int]

UP, RIGHT, DOWN, LEFT = (-1, 0), (0, 1), (1, 0), (0, -1)
_CLOCKWISE = (UP, RIGHT, DOWN, LEFT)


@dataclass(frozen=True, slots=True)
class Plan:
    """Where lanes lie in a grid of `side` x `side` cells."""

    side: int
    down: tuple[int, ...]
    up: tuple[int, ...]
    left: tuple[int, ...]
    right: tuple[int, ...]
    turns_max: int


PLANS: dict[Size, Plan] = {
    "easy": Plan(side=7, down=(3,), up=(), left=(), right=(3,), turns_max=0),
    "medium": Plan(side=14, down=(6,), up=(7,), left=(6,), right=(7,), turns_max=1),
    "hard": Plan(side=18, down=(4, 12), up=(5, 13), left=(4, 12), right=(5, 13), turns_max=2),
}


@dataclass(frozen=True, slots=True)
class Roads:
    """All routes of a plan, as arrays (R routes, L cells of the longest, E entrances)."""

    entrances: tuple[Cell, ...]
    routes: tuple[tuple[int, ...], ...]
    """Cell indices of each route."""
    route_cells: Ints
    """(R, L) cell indices, the last one repeated as padding."""
    route_length: Ints
    """(R,)"""
    entry_cells: Ints
    """(E,)"""
    road_cells: Ints
    """Sorted cell indices of all lanes."""
    junction_cells: Ints
    """Sorted cell indices where lanes cross."""


def build(plan: Plan) -> Roads:
    """Return the roads of a plan."""
    starts = _arrivals(plan)
    paths = [path for cell, heading in starts for path in _routes_from(plan, cell, heading)]
    routes = tuple(tuple(row * plan.side + column for row, column in path) for path in paths)
    longest = max(len(route) for route in routes)
    padded = [route + route[-1:] * (longest - len(route)) for route in routes]
    every = [(row, column) for row in range(plan.side) for column in range(plan.side)]
    lanes = {cell: len(_headings(plan, cell)) for cell in every}
    return Roads(
        entrances=tuple(cell for cell, _ in starts),
        routes=routes,
        route_cells=np.array(padded, np.int32),
        route_length=np.array([len(route) for route in routes], np.int32),
        entry_cells=_indices(plan, [cell for cell, _ in starts]),
        road_cells=_indices(plan, [cell for cell in every if lanes[cell] > 0]),
        junction_cells=_indices(plan, [cell for cell in every if lanes[cell] > 1]),
    )


def _indices(plan: Plan, cells: list[Cell]) -> Ints:
    return np.array([row * plan.side + column for row, column in cells], np.int32)


def _arrivals(plan: Plan) -> list[tuple[Cell, Heading]]:
    last = plan.side - 1
    return (
        [((0, column), DOWN) for column in plan.down]
        + [((last, column), UP) for column in plan.up]
        + [((row, 0), RIGHT) for row in plan.right]
        + [((row, last), LEFT) for row in plan.left]
    )


def _headings(plan: Plan, cell: Cell) -> set[Heading]:
    """Return the directions of the lanes that pass through a cell."""
    row, column = cell
    lanes = (
        (column, plan.down, DOWN),
        (column, plan.up, UP),
        (row, plan.left, LEFT),
        (row, plan.right, RIGHT),
    )
    return {heading for place, places, heading in lanes if place in places}


def _routes_from(plan: Plan, start: Cell, heading: Heading) -> list[list[Cell]]:
    """Return one path per reachable exit, in the order of the module docstring."""
    best: dict[Cell, tuple[tuple[int, ...], list[Cell]]] = {}
    for turns, path in _paths(plan, [start], heading, ()):
        end = path[-1]
        if _beside(start, end):
            continue
        known = best.get(end)
        if known is None or (len(path), len(turns)) < (len(known[1]), len(known[0])):
            best[end] = (turns, path)
    ordered = sorted(best.values(), key=lambda found: (len(found[0]), found[0], len(found[1])))
    return [path for _, path in ordered]


def _beside(start: Cell, end: Cell) -> bool:
    """Return whether the exit is the other lane of the road on which the car came."""
    return abs(start[0] - end[0]) + abs(start[1] - end[1]) == 1


def _paths(
    plan: Plan, path: list[Cell], heading: Heading, turns: tuple[int, ...]
) -> list[tuple[tuple[int, ...], list[Cell]]]:
    """Return every path to the border, early turns first; a turn is 0 (right) or 1 (left)."""
    found: list[tuple[tuple[int, ...], list[Cell]]] = []
    while True:
        if len(turns) < plan.turns_max:
            for turn, quarter in ((0, 1), (1, 3)):
                aside = _CLOCKWISE[(_CLOCKWISE.index(heading) + quarter) % 4]
                after = _ahead(plan, path[-1], aside)
                if aside in _headings(plan, path[-1]) and after is not None:
                    found += _paths(plan, [*path, after], aside, (*turns, turn))
        step = _ahead(plan, path[-1], heading)
        if step is None:
            return [*found, (turns, path)]
        path = [*path, step]


def _ahead(plan: Plan, cell: Cell, heading: Heading) -> Cell | None:
    row, column = cell[0] + heading[0], cell[1] + heading[1]
    inside = 0 <= row < plan.side and 0 <= column < plan.side
    return (row, column) if inside else None
