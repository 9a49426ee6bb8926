import numpy as np
import pytest

from models.envs import registry
from models.interpret.lanes import lanes


@pytest.mark.parametrize(("size", "count"), [("easy", 2), ("medium", 4), ("hard", 8)])
def test_every_lane_has_a_name(size: str, count: int) -> None:
    assert len(lanes(registry.make(f"traffic_junction/{size}")).names) == count


def test_outside_the_crossing_the_cell_says_which_lane_it_is() -> None:
    env = registry.make("traffic_junction/hard")
    found = lanes(env)
    by_cell: dict[int, set[int]] = {}
    for route, cells in enumerate(env.routes):
        for position, cell in enumerate(cells):
            by_cell.setdefault(cell, set()).add(int(found.of[route, position]))
    crossing = set(env.roads.junction_cells.tolist())
    assert all(len(those) == 1 for cell, those in by_cell.items() if cell not in crossing)
    assert all(len(those) == 2 for cell, those in by_cell.items() if cell in crossing)


def test_who_turns_right_changes_from_the_lane_down_to_the_lane_to_the_left() -> None:
    env = registry.make("traffic_junction/medium")
    found = lanes(env)
    straight, right = (
        [found.names[i] for i in found.of[route, : env.route_length[route]]] for route in (0, 1)
    )
    assert set(straight) == {"down, column 6"}
    assert straight[:6] == right[:6]
    assert right[6:] == ["left, row 6"] * 7


def test_the_end_of_a_shorter_route_is_repeated() -> None:
    found = lanes(registry.make("traffic_junction/medium"))
    assert np.array_equal(found.of[1, 12], found.of[1, -1])
