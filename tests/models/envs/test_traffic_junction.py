"""The rules of Traffic Junction one by one, on scenes set by hand."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from models.envs.traffic_junction import BRAKE, GAS, TrafficJunction, TrafficState, with_arrival

MEDIUM = TrafficJunction("medium")
TOP_STRAIGHT, BOTTOM_STRAIGHT, LEFT_STRAIGHT, RIGHT_STRAIGHT = 0, 3, 6, 9


def _scene(*cars: tuple[int, int], arrival: float = 0.0, seeds: int = 1, **changes: Any) -> TrafficState:
    """Return crossings with these (route, position) cars in the first slots."""
    state = with_arrival(MEDIUM.init(np.arange(seeds, dtype=np.uint64)), arrival)
    route, position, alive = state.route.copy(), state.position.copy(), state.alive.copy()
    for slot, car in enumerate(cars):
        alive[:, slot] = True
        route[:, slot], position[:, slot] = car
    return replace(state, alive=alive, route=route, position=position, **changes)


def _go(state: TrafficState, *actions: int) -> tuple[TrafficState, np.ndarray]:
    row = np.full((len(state.t), MEDIUM.agents), BRAKE, np.int32)
    row[:, : len(actions)] = actions
    return MEDIUM.step(state, row)


def test_gas_advances_one_cell_and_brake_stays() -> None:
    after, _ = _go(_scene((TOP_STRAIGHT, 3), (LEFT_STRAIGHT, 3)), GAS, BRAKE)

    assert after.position[0, :2].tolist() == [4, 3]
    assert MEDIUM.cell_of(after)[0, :2].tolist() == [4 * 14 + 6, 7 * 14 + 3]
    assert after.last_action[0, :2].tolist() == [GAS, BRAKE]


def test_a_car_that_gasses_past_its_last_cell_leaves_without_a_reward_and_frees_its_slot() -> None:
    after, reward = _go(_scene((TOP_STRAIGHT, 13)), GAS)
    later, _ = _go(after)

    assert not after.alive[0, 0]
    assert reward[0, 0] == 0
    assert after.completed[0].tolist() == [True] + [False] * 9
    assert not later.completed.any()


def test_each_car_pays_for_every_step_since_it_appeared() -> None:
    state = _scene((TOP_STRAIGHT, 0))
    paid = []
    for _ in range(3):
        state, reward = _go(state, BRAKE)
        paid.append(reward[0, 0].item())

    assert paid == pytest.approx([-0.01, -0.02, -0.03])


def test_cars_in_one_cell_pay_ten_each_and_again_while_they_stay() -> None:
    state, reward = _go(_scene((TOP_STRAIGHT, 5), (RIGHT_STRAIGHT, 6)), GAS, GAS)

    assert MEDIUM.cell_of(state)[0, :2].tolist() == [6 * 14 + 6] * 2
    assert reward[0, :2].tolist() == pytest.approx([-10.01, -10.01])
    state, reward = _go(state, BRAKE, BRAKE)
    assert reward[0, :2].tolist() == pytest.approx([-10.02, -10.02])


def test_a_collision_is_remembered_by_the_episode_and_by_the_car_only() -> None:
    state, _ = _go(_scene((TOP_STRAIGHT, 5), (RIGHT_STRAIGHT, 6)), GAS, GAS)
    state, _ = _go(state, GAS, GAS)

    assert not MEDIUM.collided(state).any()
    assert state.collided_ever[0, :3].tolist() == [True, True, False]
    assert not MEDIUM.success(state)[0]
    for _ in range(8):
        state, _ = _go(state, GAS, GAS)
    assert not state.alive.any()
    assert not state.collided_ever.any()
    assert not MEDIUM.success(state)[0]


def test_two_cars_that_change_places_do_not_collide() -> None:
    # no route leads against a lane, so the scene is a pair of made-up routes
    env = TrafficJunction("easy")
    env.route_cells = np.array([[0, 1, 2, 3, 4, 5, 6], [6, 5, 4, 3, 2, 1, 0]], np.int32)
    state = with_arrival(env.init(np.zeros(1, np.uint64)), 0.0)
    alive = np.array([[True, True, False, False, False]])
    scene = replace(state, alive=alive, route=np.array([[0, 1, 0, 0, 0]], np.int32))
    scene = replace(scene, position=np.array([[2, 3, 0, 0, 0]], np.int32))  # on cells 2 and 3
    after, _ = env.step(scene, np.zeros((1, 5), np.int32))

    assert env.cell_of(after)[0, :2].tolist() == [3, 2]
    assert not env.collided(after).any()


def test_a_car_that_waits_on_its_entry_cell_can_be_hit() -> None:
    after, reward = _go(_scene((TOP_STRAIGHT, 0), arrival=1.0), BRAKE)

    assert after.collided_ever[0, 0]
    assert reward[0, 0] == pytest.approx(-10.01)
    assert after.fresh.sum() == 4
    assert sorted(reward[0].tolist()) == pytest.approx([-10.01, -10] + [0] * 8)


def test_arrivals_stop_when_every_slot_is_taken() -> None:
    state = _scene(*[(LEFT_STRAIGHT, slot) for slot in range(1, 9)], arrival=1.0, seeds=50)  # 8 cars, 2 slots
    after, _ = _go(state, *[BRAKE] * 8)

    assert after.alive.all()
    assert set(after.route[:, 8:].ravel() // 3) == {0, 1}  # the first two entrances were served


def test_a_new_car_may_take_any_empty_slot_and_any_route_of_its_entrance() -> None:
    after, _ = _go(_scene((LEFT_STRAIGHT, 3), arrival=1.0, seeds=2000), GAS)
    taken = after.fresh.mean(0)

    assert taken[0] == 0
    assert taken[1:] == pytest.approx(4 / 9, abs=0.05)
    assert np.bincount(after.route[after.fresh], minlength=12) / 2000 == pytest.approx(1 / 3, abs=0.05)


def test_a_new_car_inherits_nothing_from_the_slots_last_one() -> None:
    crash = [(TOP_STRAIGHT, 13), (TOP_STRAIGHT, 13)] + [(LEFT_STRAIGHT, slot) for slot in range(1, 9)]
    state = _scene(
        *crash, arrival=1.0, age=np.full((1, 10), 7, np.int32), last_action=np.ones((1, 10), np.int32)
    )
    state = replace(state, collided_ever=np.ones((1, 10), np.bool_))
    after, _ = _go(state, GAS, GAS)

    assert after.fresh[0, :2].all()
    assert after.completed[0, :2].all()  # said of the car that left
    for field in (after.age, after.last_action, after.position, after.collided_ever):
        assert not field[0, :2].any()


def test_an_observation_is_last_action_route_cell_and_cars_there() -> None:
    state = _scene((RIGHT_STRAIGHT, 5), (RIGHT_STRAIGHT, 5), last_action=np.ones((1, 10), np.int32))
    seen = MEDIUM.observe(state)[0, 0]
    cell = MEDIUM.roads.road_cells.tolist().index(6 * 14 + 8)

    assert MEDIUM.observation_size == 55
    assert seen[0] == 1
    assert seen[1] == pytest.approx(9 / 11)
    assert np.flatnonzero(seen[2:-1]).tolist() == [cell]
    assert seen[-1] == 2


def test_gas_would_lead_to_the_next_cell() -> None:
    ahead = MEDIUM.next_cell(_scene((TOP_STRAIGHT, 3), (TOP_STRAIGHT, 13)))

    assert ahead[0, :3].tolist() == [4 * 14 + 6, -1, -1]


def test_no_car_arrives_in_the_guests_cell_or_slot() -> None:
    guest = np.full(300, 0, np.int32)
    waiting, _ = _go(_scene((TOP_STRAIGHT, 0), arrival=1.0, seeds=300, guest=guest), BRAKE)
    gone, _ = _go(_scene((TOP_STRAIGHT, 13), arrival=1.0, seeds=300, guest=guest), GAS)

    assert not waiting.collided_ever.any()
    assert (waiting.fresh.sum(1) == 3).all()
    assert not gone.alive[:, 0].any()
    assert (gone.fresh.sum(1) == 4).all()


def test_no_car_arrives_when_only_the_guests_slot_is_empty() -> None:
    nine = [(LEFT_STRAIGHT, position) for position in range(1, 10)]
    state = _scene(*nine, arrival=1.0, seeds=20, guest=np.full(20, 9, np.int32))
    after, _ = _go(state, *[BRAKE] * 9)

    assert not after.fresh.any()
    assert np.array_equal(after.position, state.position)
    assert np.array_equal(after.route, state.route)


def test_arrivals_stop_at_the_largest_number_of_cars() -> None:
    state = _scene((LEFT_STRAIGHT, 3), arrival=1.0, seeds=3, cars_max=np.array([1, 3, 10], np.int32))
    after, _ = _go(state, GAS)

    assert after.alive.sum(1).tolist() == [1, 3, 5]


def test_the_arrival_probability_can_differ_between_episodes_and_steps() -> None:
    empty = MEDIUM.init(np.arange(2000, dtype=np.uint64))
    rates = np.repeat([0.0, 0.2], 1000)
    after, _ = _go(with_arrival(empty, rates))

    assert not after.alive[:1000].any()
    assert after.alive[1000:].sum(1).mean() == pytest.approx(0.8, abs=0.1)
    with pytest.raises(ValueError, match="between 0 and 1"):
        with_arrival(empty, 1.5)
