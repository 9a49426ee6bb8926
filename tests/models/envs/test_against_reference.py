"""The batched worlds against the plain-Python ones, over a thousand random episodes each."""

import numpy as np
import pytest

from models.envs.api import take
from models.envs.grid import towards
from models.envs.parent_child import ParentChild
from models.envs.predator_prey import PredatorPrey
from models.envs.traffic_junction import TrafficJunction, TrafficState, with_arrival
from tests.models.envs import reference

EPISODES = 1000
OBSERVED = 60  # episodes of which every observation is compared, too


def _arrivals(env: TrafficJunction) -> list[list[reference.Route]]:
    if env.name.endswith("easy"):
        return reference.EASY
    if env.name.endswith("medium"):
        return reference.MEDIUM
    paths = [[divmod(cell, env.shape[1]) for cell in route] for route in env.routes]
    return [paths[first : first + 7] for first in range(0, 56, 7)]  # test_roads.py judges these


def _played(
    env: TrafficJunction, p: np.ndarray, actions: np.ndarray
) -> list[tuple[TrafficState, np.ndarray]]:
    state = with_arrival(env.init(np.arange(EPISODES, dtype=np.uint64)), p)
    frames = []
    for row in actions:
        state, reward = env.step(state, row)
        frames.append((state, reward))
    return frames


def _listed(state: TrafficState) -> list[list[list[int]]]:
    """Return the fields that `_expected` names, as nested lists: field, episode, slot."""
    names = ("alive", "route", "position", "age", "last_action", "collided_ever", "completed")
    return [getattr(state, name).tolist() for name in names]


def _expected(frame: reference.Frame) -> list[list[int]]:
    fields = ("route", "position", "age", "last_action", "collided")
    alive = [car is not None for car in frame.cars]
    return [alive, *[_cars(frame, field) for field in fields], frame.completed]


def _cars(frame: reference.Frame, field: str, empty: int = 0) -> list[int]:
    return [empty if car is None else int(getattr(car, field)) for car in frame.cars]


def _observation(
    frame: reference.Frame, slot: int, env: TrafficJunction, roads: dict[int, int]
) -> np.ndarray:
    seen = np.zeros(env.observation_size, np.float32)
    car = frame.cars[slot]
    if car is not None:
        everyone = [other.cell for other in frame.cars if other is not None]
        seen[0] = car.last_action
        seen[1] = np.float32(car.route) / np.float32(len(env.routes) - 1)
        seen[2 + roads[car.cell[0] * env.shape[1] + car.cell[1]]] = 1
        seen[-1] = everyone.count(car.cell)
    return seen


@pytest.mark.parametrize("size", ["easy", "medium", "hard"])
def test_traffic_agrees_with_the_rules_in_every_number(size: str) -> None:
    env = TrafficJunction(size)
    draws = np.random.default_rng(5)
    p = draws.choice([0.02, 0.05, 0.1, 0.3, 1.0], EPISODES)
    keen = draws.uniform(0.3, 1.0, EPISODES)  # each episode has its own share of gas
    actions = (draws.random((env.steps_max, EPISODES, env.agents)) > keen[:, None]).astype(np.int32)
    played = _played(env, p, actions)
    arrivals = _arrivals(env)
    cells = sorted({cell for route in env.routes for cell in route})
    roads = {cell: place for place, cell in enumerate(cells)}
    fields = [_listed(state) for state, _ in played]
    crashed = [state.crashed.tolist() for state, _ in played]
    seen = {t: env.observe(take(played[t][0], slice(OBSERVED))) for t in range(0, env.steps_max, 9)}
    rewards = np.array([reward for _, reward in played])  # (T, B, N)
    for b in range(EPISODES):
        expected_rewards = []
        for t, frame in enumerate(reference.traffic(arrivals, env.agents, p[b], b, actions[:, b].tolist())):
            assert [field[b] for field in fields[t]] == _expected(frame)
            assert crashed[t][b] == frame.crashed
            expected_rewards.append(frame.reward)
            if b < OBSERVED and t in seen:
                expected = [_observation(frame, slot, env, roads) for slot in range(env.agents)]
                np.testing.assert_array_equal(seen[t][b], expected)
        np.testing.assert_allclose(rewards[:, b], expected_rewards, rtol=1e-6)


def test_the_search_agrees_with_the_rules_in_every_number() -> None:
    env = ParentChild()
    actions = np.random.default_rng(6).integers(0, env.actions, (25, EPISODES, 2)).astype(np.int32)
    state = env.init(np.arange(EPISODES, dtype=np.uint64))
    searches = [reference.search(seed) for seed in range(EPISODES)]
    for row in actions:
        observation = env.observe(state)
        state, reward = env.step(state, row)
        for b, before in enumerate(searches):
            if b < OBSERVED:
                seen = observation[b].reshape(2, 9, 85)
                windows = [[{int(i): int(c[i]) for i in np.flatnonzero(c)} for c in seat] for seat in seen]
                assert windows == [before.window(0), before.window(1)]
            after = searches[b] = reference.move(before, int(row[b, 0]))
            assert (state.parent_row[b], state.parent_col[b]) == after.parent
            assert (state.child_row[b], state.child_col[b]) == after.child
            assert env.steps(state)[b] == after.steps
            assert env.done(state)[b] == after.over
            assert env.success(state)[b] == (after.parent == after.child)
            assert reward[b].tolist() == [np.float32(after.reward)] * 2


def _straight(cells: np.ndarray, side: int) -> np.ndarray:
    return towards(*divmod(cells, side), *divmod(cells[:, -1:], side))


@pytest.mark.parametrize(
    ("size", "side", "predators", "vision", "steps"), [("5x5", 5, 3, 0, 20), ("10x10", 10, 5, 1, 40)]
)
def test_the_hunt_agrees_with_the_rules_in_every_number(
    size: str, side: int, predators: int, vision: int, steps: int
) -> None:
    env = PredatorPrey(size)
    draws = np.random.default_rng(7)
    shape = (steps + 2, EPISODES, predators + 1)
    actions = draws.integers(0, env.actions, shape).astype(np.int32)
    keen = draws.random(shape) < draws.random((EPISODES, 1))  # each episode has its own share of the way
    state = env.init(np.arange(EPISODES, dtype=np.uint64))
    hunts = [reference.hunt(side, predators, vision, seed) for seed in range(EPISODES)]
    for step, stray in enumerate(actions):
        observation = env.observe(state)
        over = step >= steps
        row = np.where(keen[step], _straight(env.cell_of(state), side), stray).astype(np.int32)
        state, reward = env.step(state, row)
        cells, success = env.cell_of(state).tolist(), env.success(state).tolist()
        expected = []
        for b, before in enumerate(hunts):
            if b < OBSERVED:
                seen = observation[b].reshape(predators + 1, (2 * vision + 1) ** 2, side**2 + 4)
                windows = [[{int(i): int(c[i]) for i in np.flatnonzero(c)} for c in seat] for seat in seen]
                assert windows == [before.window(seat) for seat in range(predators + 1)]
            after = hunts[b] = before if over else reference.chase(before, row[b].tolist())
            assert cells[b] == [side * r + c for r, c in [*after.predators, after.prey]]
            assert success[b] == after.caught
            expected.append([0.0] * (predators + 1) if over else after.rewards())
        np.testing.assert_allclose(reward, expected, rtol=1e-6, atol=1e-8)
        assert (env.done(state) == (step + 1 >= steps)).all()
    assert 0.1 < np.mean([hunt.caught for hunt in hunts]) < 0.9
