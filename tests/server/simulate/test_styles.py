"""Robots decide from payloads alone, and the sensible ones learn."""

from typing import Any

import pytest

from server.simulate import styles
from server.simulate.styles import BRAKE, DOWN, GO, LEFT, RIGHT, STAY, UP


def parent(**changes: Any) -> dict[str, Any]:
    view = {
        "role": "parent",
        "actions": [0, 1, 2, 3, 4],
        "size": 9,
        "vision": 1,
        "cell": [4, 4],
        "trail": [[4, 4]],
    }
    return {**view, "child": None, "sign": 3, "over": None, **changes}


def child(**changes: Any) -> dict[str, Any]:
    view = {"role": "child", "actions": [1, 2, 3], "size": 9, "vision": 1, "cell": [0, 0], "parent": [8, 8]}
    return {**view, "sign": None, "over": None, **changes}


def driver(*triangles: list[float]) -> dict[str, Any]:
    route = [[7, column] for column in range(14)]
    return {"role": "driver", "actions": [0, 1], "route": route, "position": 4, "triangles": list(triangles)}


@pytest.fixture
def sensible() -> styles.Player:
    return styles.player("sensible", "7", 0)


@pytest.mark.parametrize(
    ("goal", "move"), [((1, 4), UP), ((4, 7), RIGHT), ((8, 5), DOWN), ((4, 0), LEFT), ((4, 4), STAY)]
)
def test_the_way_to_a_cell_is_a_straight_one(goal: tuple[int, int], move: int) -> None:
    assert styles.towards((4, 4), goal) == move


def test_a_parent_goes_to_the_child_it_sees(sensible: styles.Player) -> None:
    assert sensible.decide(parent(child=[4, 5])) == RIGHT


def test_a_parent_goes_where_a_known_sign_led_before(sensible: styles.Player) -> None:
    sensible.learn(parent(over={"outcome": "found", "child": [0, 4]}))
    assert sensible.decide(parent()) == UP
    sensible.learn(parent(sign=5, over={"outcome": "found", "child": [8, 4]}))
    assert sensible.decide(parent(sign=5)) == DOWN


def test_a_parent_without_a_clue_sees_the_whole_board_in_the_end(sensible: styles.Player) -> None:
    cell, trail = [0, 0], [[0, 0]]
    shifts = {UP: (-1, 0), RIGHT: (0, 1), DOWN: (1, 0), LEFT: (0, -1), STAY: (0, 0)}
    for _ in range(60):
        move = sensible.decide(parent(cell=cell, trail=trail, sign=None))
        cell = [min(8, max(0, cell[0] + shifts[move][0])), min(8, max(0, cell[1] + shifts[move][1]))]
        trail.append(cell)
    near = {(r + a, c + b) for r, c in trail for a in (-1, 0, 1) for b in (-1, 0, 1)}
    assert {(r, c) for r in range(9) for c in range(9)} <= near


def test_a_child_chooses_the_sign_that_led_the_parent_near(sensible: styles.Player) -> None:
    for sign, end in ((1, [8, 8]), (2, [1, 0]), (3, [8, 0])):
        sensible.learn(child(sign=sign, walk=[[4, 4], end], over={"outcome": "not_found"}))
    assert sensible.decide(child()) == 2
    assert sensible.decide(child(cell=[8, 7])) == 1


def test_blank_rounds_teach_nothing(sensible: styles.Player) -> None:
    sensible.learn(parent(sign=None, over={"outcome": "found", "child": [0, 0]}))
    sensible.learn(child(sign=None, walk=[[0, 0]], over={"outcome": "found"}))
    assert sensible.decide(child()) in {1, 2, 3}


def test_a_driver_waits_for_a_likely_car_ahead_but_not_for_ever(sensible: styles.Player) -> None:
    ahead = driver([7, 5, 0.6])
    decisions = [sensible.decide(ahead) for _ in range(styles.PATIENCE + 1)]
    assert decisions == [BRAKE] * styles.PATIENCE + [GO]


def test_a_driver_goes_on_when_triangles_are_elsewhere_or_faint(sensible: styles.Player) -> None:
    assert sensible.decide(driver([7, 9, 0.9], [7, 5, 0.1])) == GO
    assert sensible.decide(driver()) == GO


def test_a_careless_robot_picks_every_allowed_action_and_no_other() -> None:
    careless = styles.player("random", "1", 0)
    assert {careless.decide(child()) for _ in range(60)} == {1, 2, 3}


def test_the_same_seed_gives_the_same_choices_and_another_seed_others() -> None:
    def chosen(seed: str) -> list[int]:
        player = styles.player("random", seed, 4)
        return [player.decide(parent()) for _ in range(40)]

    assert chosen("9") == chosen("9") != chosen("10")


def test_a_mixed_crowd_alternates() -> None:
    kinds = [type(styles.player("mixed", "1", index)).__name__ for index in range(4)]
    assert kinds == ["Sensible", "Careless"] * 2
