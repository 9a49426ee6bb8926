"""What every environment promises; a new one only has to be in the registry to be tested here."""

from dataclasses import FrozenInstanceError, fields
from typing import Any

import numpy as np
import pytest

from models.envs.api import join, put, take, where
from models.envs.registry import NAMES, UnknownTaskError, make

B = 40


@pytest.fixture(params=NAMES)
def env(request: pytest.FixtureRequest) -> Any:
    return make(request.param)


def _seeds(first: int = 0) -> np.ndarray:
    return np.arange(first, first + B, dtype=np.uint64)


def _actions(env: Any, batch: int = B) -> np.ndarray:
    """Return (T, B, N) random actions; a little longer than an episode."""
    draws = np.random.default_rng(1)
    return draws.integers(0, env.actions, (env.steps_max + 2, batch, env.agents)).astype(np.int32)


def _arrays(state: Any) -> dict[str, np.ndarray]:
    return {field.name: getattr(state, field.name) for field in fields(state)}


def _equal(one: Any, other: Any) -> bool:
    mine, yours = _arrays(one), _arrays(other)
    return all(np.array_equal(mine[name], yours[name]) for name in mine)


def _played(env: Any, seeds: np.ndarray, actions: np.ndarray) -> tuple[list[Any], list[np.ndarray]]:
    states, rewards = [env.init(seeds)], []
    for row in actions:
        state, reward = env.step(states[-1], row)
        states.append(state)
        rewards.append(reward)
    return states, rewards


def test_it_says_what_it_is(env: Any) -> None:
    assert env.name in NAMES
    assert env.version >= 1
    assert env.cells == env.shape[0] * env.shape[1]
    assert env.speaks.shape == (env.agents,)
    assert env.speaks.dtype == np.bool_
    assert env.speaks.any()
    assert isinstance(env.message_held, bool)


def test_shapes_and_types_are_those_of_the_protocol(env: Any) -> None:
    states, rewards = _played(env, _seeds(), _actions(env))
    for state in states:
        assert env.observe(state).shape == (B, env.agents, env.observation_size)
        assert env.observe(state).dtype == np.float32
        assert env.cell_of(state).dtype == np.int32
        for per_seat in (env.alive(state), env.fresh(state), env.cell_of(state)):
            assert per_seat.shape == (B, env.agents)
        for per_episode in (env.done(state), env.success(state)):
            assert per_episode.shape == (B,)
            assert per_episode.dtype == np.bool_
    assert {(reward.shape, reward.dtype.name) for reward in rewards} == {((B, env.agents), "float32")}


def test_a_state_is_frozen_and_holds_integers_with_a_batch_axis(env: Any) -> None:
    states, _ = _played(env, _seeds(), _actions(env))
    kinds = {name: array.dtype for name, array in _arrays(states[0]).items()}
    for state in states:
        for name, array in _arrays(state).items():
            assert len(array) == B
            assert array.dtype.kind in "iub"
            assert array.dtype == kinds[name]
    with pytest.raises(FrozenInstanceError):
        states[0].t = states[0].t


def test_nothing_writes_into_its_inputs(env: Any) -> None:
    seeds, actions = _seeds(), _actions(env)
    for array in (seeds, actions):
        array.flags.writeable = False
    state = env.init(seeds)
    for row in actions:
        for array in _arrays(state).values():
            array.flags.writeable = False
        for ask in (env.observe, env.alive, env.fresh, env.cell_of, env.done, env.success):
            ask(state)
        state, _ = env.step(state, row)


def test_a_state_does_not_share_memory_with_the_seeds(env: Any) -> None:
    seeds = _seeds()
    state = env.init(seeds)
    seeds += np.uint64(1)

    assert _equal(state, env.init(_seeds()))


def test_the_same_seeds_and_actions_give_the_same_episodes(env: Any) -> None:
    once, paid_once = _played(env, _seeds(), _actions(env))
    again, paid_again = _played(env, _seeds(), _actions(env))

    assert all(map(_equal, once, again))
    assert np.array_equal(paid_once, paid_again)


def test_other_seeds_give_other_episodes(env: Any) -> None:
    once, _ = _played(env, _seeds(), _actions(env))
    other, _ = _played(env, _seeds(first=B), _actions(env))

    assert not np.array_equal(env.cell_of(once[env.steps_max]), env.cell_of(other[env.steps_max]))


def test_an_episode_is_the_same_alone_and_in_any_batch(env: Any) -> None:
    seeds, actions = _seeds(), _actions(env)
    together, paid = _played(env, seeds, actions)
    order = np.random.default_rng(2).permutation(B)
    shuffled, _ = _played(env, seeds[order], actions[:, order])
    alone, paid_alone = _played(env, seeds[7:8], actions[:, 7:8])
    for t, state in enumerate(together):
        assert _equal(take(state, order), shuffled[t])
        assert _equal(take(state, slice(7, 8)), alone[t])
        assert np.array_equal(env.observe(state)[7:8], env.observe(alone[t]))
    assert np.array_equal(np.array(paid)[:, 7:8], np.array(paid_alone))


def test_absent_seats_observe_zeros_and_stand_nowhere(env: Any) -> None:
    states, rewards = _played(env, _seeds(), _actions(env))
    for state in states:
        alive, cell = env.alive(state), env.cell_of(state)
        assert not env.observe(state)[~alive].any()
        assert (cell[~alive] == -1).all()
        assert ((cell[alive] >= 0) & (cell[alive] < env.cells)).all()
        assert not (env.fresh(state) & ~alive).any()
    for reward, state in zip(rewards, states[1:], strict=True):
        assert not reward[~env.alive(state)].any()


def test_actions_of_absent_seats_are_ignored(env: Any) -> None:
    states, _ = _played(env, _seeds(), _actions(env))
    for state, row in zip(states, _actions(env), strict=False):
        other = np.where(env.alive(state), row, (row + 1) % env.actions).astype(np.int32)
        assert _equal(env.step(state, row)[0], env.step(state, other)[0])


def test_a_done_episode_stays_as_it_is_and_pays_nothing(env: Any) -> None:
    states, rewards = _played(env, _seeds(), _actions(env))
    for before, after, reward in zip(states, states[1:], rewards, strict=False):
        over = env.done(before)
        assert _equal(take(before, over), take(after, over))
        assert not reward[over].any()


def test_every_episode_is_done_after_its_last_step_and_not_at_its_first(env: Any) -> None:
    states, _ = _played(env, _seeds(), _actions(env))

    assert not env.done(states[0]).any()
    assert env.done(states[env.steps_max]).all()


def test_batches_can_be_cut_chosen_and_joined(env: Any) -> None:
    states, _ = _played(env, _seeds(), _actions(env))
    early, late = states[1], states[9]
    chosen = np.arange(B) % 3 == 0
    mixed = where(chosen, late, early)

    assert _equal(take(mixed, chosen), take(late, chosen))
    assert _equal(take(mixed, ~chosen), take(early, ~chosen))
    assert _equal(put(early, chosen, take(late, chosen)), mixed)
    assert _equal(
        put(early, np.array([3, 1]), take(late, np.array([3, 1]))),
        where(np.isin(np.arange(B), [1, 3]), late, early),
    )
    assert _equal(join([take(late, slice(0, 5)), take(late, slice(5, None))]), late)


def test_an_unknown_task_is_answered_with_the_list_of_tasks() -> None:
    with pytest.raises(UnknownTaskError, match="unknown task 'chess'; known tasks: traffic_junction/easy, "):
        make("chess")


def test_one_task_is_built_once() -> None:
    assert make("parent_child") is make("parent_child")
