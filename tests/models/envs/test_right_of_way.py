from dataclasses import replace

import numpy as np
import pytest

from models.envs.right_of_way import right_of_way
from models.envs.traffic_junction import BRAKE, GAS, TrafficJunction, TrafficState, with_arrival

B = 400


def _crowded(env: TrafficJunction, seed: int) -> TrafficState:
    """Return random scenes in which every car has a cell of its own and no car arrives."""
    draws = np.random.default_rng(seed)
    state = with_arrival(env.init(np.arange(B, dtype=np.uint64)), 0.0)
    route = draws.integers(0, len(env.routes), (B, env.agents))
    position = draws.integers(0, env.route_length[route])
    state = replace(
        state,
        alive=draws.random((B, env.agents)) < draws.uniform(0.2, 1.0, (B, 1)),
        route=route.astype(np.int32),
        position=position.astype(np.int32),
        end=np.full(B, 10_000, np.int32),
    )
    cell = env.cell_of(state)
    earlier = np.tril(cell[:, :, None] == cell[:, None, :], k=-1).any(2)
    return replace(state, alive=state.alive & ~earlier)


@pytest.mark.parametrize("size", ["easy", "medium", "hard"])
def test_it_never_brings_two_cars_together_and_never_locks(size: str) -> None:
    env = TrafficJunction(size)
    state = _crowded(env, seed=1)
    assert state.alive.sum(1).max() > env.agents // 2
    for _ in range(4 * env.steps_max):
        actions = right_of_way(env, state)
        driving = state.alive.any(1)
        assert (driving == ((actions == GAS) & state.alive).any(1)).all()  # somebody always moves
        state, _ = env.step(state, actions)
    assert env.success(state).all()
    assert not state.alive.any()


def test_a_car_inside_the_junction_goes_before_one_that_enters() -> None:
    env = TrafficJunction("medium")
    state = with_arrival(env.init(np.zeros(1, np.uint64)), 0.0)
    alive = np.arange(10)[None] < 2
    top, right = (0, 5), (9, 6)  # (5, 6) goes down into (6, 6); (6, 7) goes left into it
    scene = replace(state, alive=alive)
    route, position = scene.route.copy(), scene.position.copy()
    (route[0, 0], position[0, 0]), (route[0, 1], position[0, 1]) = top, right

    assert right_of_way(env, replace(scene, route=route, position=position))[0].tolist() == [
        BRAKE,
        GAS,
        *[BRAKE] * 8,
    ]


def test_it_does_not_depend_on_the_batch() -> None:
    env = TrafficJunction("medium")
    state = _crowded(env, seed=2)
    together = right_of_way(env, state)
    rows = [type(state)(**{f: getattr(state, f)[b : b + 1] for f in state.__slots__}) for b in range(20)]

    assert np.array_equal(together[:20], np.concatenate([right_of_way(env, row) for row in rows]))
