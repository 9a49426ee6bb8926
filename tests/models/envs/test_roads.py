from collections import deque
from itertools import pairwise

import numpy as np
import pytest

from models.envs import roads
from models.envs.roads import PLANS, build


def _cells(route: tuple[int, ...], side: int) -> list[tuple[int, int]]:
    return [divmod(cell, side) for cell in route]


def _turns(path: list[tuple[int, int]]) -> int:
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(path)]
    return sum(one != two for one, two in pairwise(steps))


def _shortest(start: tuple[int, int], side: int, plan: roads.Plan) -> dict[tuple[int, int], int]:
    """Return the number of cells to every border cell, by breadth-first search over the lanes."""
    distance = {start: 1}
    queue = deque([start])
    while queue:
        row, column = queue.popleft()
        ways = [
            ((1, 0), column in plan.down),
            ((-1, 0), column in plan.up),
            ((0, -1), row in plan.left),
            ((0, 1), row in plan.right),
        ]
        for (down, right), open_ in ways:
            ahead = (row + down, column + right)
            if open_ and ahead not in distance and min(ahead) >= 0 and max(ahead) < side:
                distance[ahead] = distance[row, column] + 1
                queue.append(ahead)
    return distance


@pytest.mark.parametrize(
    ("size", "arrivals", "routes", "lengths"),
    [
        ("easy", [(0, 3), (3, 0)], 2, {7}),
        ("medium", [(0, 6), (13, 7), (7, 0), (6, 13)], 12, {13, 14, 15}),
        (
            "hard",
            [(0, 4), (0, 12), (17, 5), (17, 13), (5, 0), (13, 0), (4, 17), (12, 17)],
            56,
            {9, 11, 16, 17, 18, 19, 20, 25, 26, 27},
        ),
    ],
)
def test_each_size_has_its_arrivals_and_routes(
    size: roads.Size, arrivals: list[tuple[int, int]], routes: int, lengths: set[int]
) -> None:
    built = build(PLANS[size])

    assert list(built.entrances) == arrivals
    assert len(built.routes) == routes
    assert set(built.route_length.tolist()) == lengths


def test_routes_of_medium_are_straight_right_left_per_arrival() -> None:
    assert build(PLANS["medium"]).route_length.tolist() == [14, 13, 15] * 4


@pytest.mark.parametrize("size", ["easy", "medium", "hard"])
def test_a_route_is_the_shortest_legal_way_from_its_entrance_to_an_exit(size: roads.Size) -> None:
    plan = PLANS[size]
    built = build(plan)
    per_entrance = len(built.routes) // len(built.entrances)
    for number, route in enumerate(built.routes):
        path = _cells(route, plan.side)
        distance = _shortest(path[0], plan.side, plan)
        assert path[0] == built.entrances[number // per_entrance]
        assert len(path) == distance[path[-1]]
        assert all(distance[b] == distance[a] + 1 for a, b in pairwise(path))
        assert path[-1][0] in (0, plan.side - 1) or path[-1][1] in (0, plan.side - 1)
        assert _turns(path) <= plan.turns_max


def test_hard_goes_from_every_entrance_to_every_exit_but_that_of_its_own_road() -> None:
    plan = PLANS["hard"]
    built = build(plan)
    exits = {_cells(route, plan.side)[-1] for route in built.routes}
    for entrance in range(8):
        row, column = built.entrances[entrance]
        own_road = {cell for cell in exits if abs(cell[0] - row) + abs(cell[1] - column) == 1}
        ends = [_cells(route, plan.side)[-1] for route in built.routes[7 * entrance : 7 * entrance + 7]]
        assert len(own_road) == 1
        assert len(ends) == 7
        assert set(ends) == exits - own_road


@pytest.mark.parametrize("size", ["easy", "medium", "hard"])
def test_routes_of_one_entrance_are_ordered_by_turns(size: roads.Size) -> None:
    plan = PLANS[size]
    built = build(plan)
    per_entrance = len(built.routes) // len(built.entrances)
    turns = np.array([_turns(_cells(route, plan.side)) for route in built.routes]).reshape(-1, per_entrance)

    assert (np.diff(turns, axis=1) >= 0).all()
    assert (turns[:, 0] == 0).all()


def test_the_padded_table_repeats_the_last_cell() -> None:
    built = build(PLANS["medium"])
    for number, route in enumerate(built.routes):
        row = built.route_cells[number].tolist()
        assert tuple(row[: len(route)]) == route
        assert set(row[len(route) :]) <= {route[-1]}


@pytest.mark.parametrize(
    ("size", "road", "junction"), [("easy", 13, 1), ("medium", 52, 4), ("hard", 128, 16)]
)
def test_lanes_cover_roads_and_cross_in_junctions(size: roads.Size, road: int, junction: int) -> None:
    built = build(PLANS[size])

    assert len(built.road_cells) == road
    assert len(built.junction_cells) == junction
    assert set(built.route_cells.ravel().tolist()) == set(built.road_cells.tolist())
