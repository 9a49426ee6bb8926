"""The rules that warm starts imitate: one drives well, and careful where it says so; one walks straight."""

from dataclasses import replace

import numpy as np
import pytest

from models import rollout
from models.envs import registry
from models.envs.grid import DOWN, LEFT, RIGHT, STAY, UP
from models.envs.starts import human_start
from models.envs.traffic_junction import BRAKE, GAS
from models.training.imitation import has_rule, intent, labels


class Rule:
    name = "rule"

    def actions(self, env, state):
        return labels(env, state)


@pytest.fixture
def env():
    return registry.make("traffic_junction/medium")


def placed(env, *cars):
    """One episode with cars (route, position)."""
    state = env.init(np.zeros(1, np.uint64))
    alive, route, position = state.alive.copy(), state.route.copy(), state.position.copy()
    for seat, (way, place) in enumerate(cars):
        alive[0, seat], route[0, seat], position[0, seat] = True, way, place
    return replace(state, alive=alive, route=route, position=position)


def test_the_rule_hardly_ever_crashes(env):
    played = rollout.episodes(env, Rule(), np.arange(400, dtype=np.uint64))
    assert played.success.mean() > 0.99
    human = rollout.trials(rollout.episodes(env, Rule(), np.arange(200, dtype=np.uint64), "human"))
    assert human.arrived.mean() > 0.99


def test_a_free_road_means_gas_and_an_empty_seat_brakes(env):
    assert labels(env, placed(env, (0, 3)))[0].tolist() == [GAS] + [BRAKE] * 9


@pytest.mark.parametrize("position", [1, 4, 5, 6, 7, 8, 12])
def test_a_car_never_enters_a_cell_that_is_taken_now(env, position):
    state = placed(env, (0, position), (0, position + 1))
    assert labels(env, state)[0, :2].tolist() == [BRAKE, GAS]


def test_a_car_on_its_entry_cell_follows_closely(env):
    assert labels(env, placed(env, (0, 0), (0, 1)))[0, :2].tolist() == [GAS, GAS]


def test_a_full_junction_turns_instead_of_locking(env):
    straight = (0, 3, 6, 9)
    assert labels(env, placed(env, *((route, 6) for route in straight)))[0, :4].tolist() == [GAS] * 4


def test_who_brakes_at_random_is_hardly_ever_hit_from_behind(env):
    begun = human_start(env, np.arange(300, dtype=np.uint64))
    state, draws, hit = begun.state, np.random.default_rng(0), np.zeros(300, np.bool_)
    for _ in range(40):
        actions, driving = labels(env, state), state.alive[:, -1]
        actions[:, -1] = np.where(draws.random(300) < 0.3, BRAKE, actions[:, -1])
        state, _ = env.step(state, actions)
        hit |= env.collided(state)[:, -1] & driving
    assert hit.mean() < 0.05


def test_whoever_is_inside_the_junction_goes_first(env):
    inside, outside = (
        (0, 6),
        (6, 5),
    )  # from the top, straight, at (6, 6); from the left, about to enter (7, 6)
    state = placed(env, outside, inside)
    assert intent(env, state)[0, 0] == intent(env, state)[0, 1]
    assert labels(env, state)[0, :2].tolist() == [BRAKE, GAS]


def test_a_car_about_to_leave_intends_no_cell(env):
    state = placed(env, (0, 13), (1, 12), (1, 11))
    assert intent(env, state)[0, :3].tolist() == [-1, -1, env.routes[1][12]]


def test_predators_are_told_to_go_straight_rows_first_and_the_prey_to_stay():
    hunt = registry.make("predator_prey/5x5")
    state = hunt.place(np.zeros(2, np.uint64), np.array([[0, 14, 12], [22, 11, 4]]), np.array([12, 12]))
    assert labels(hunt, state).tolist() == [[DOWN, LEFT, STAY, STAY], [UP, RIGHT, DOWN, STAY]]


def test_a_search_has_no_rule_to_imitate():
    assert not has_rule("parent_child")
    with pytest.raises(KeyError):
        labels(registry.make("parent_child"), None)
