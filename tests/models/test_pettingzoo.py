import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

from models.envs.registry import NAMES, make
from models.pettingzoo import parallel_env
from models.policies import scripted


@pytest.mark.parametrize("task", NAMES)
def test_it_passes_the_official_tests(task: str) -> None:
    parallel_api_test(parallel_env(task), num_cycles=200)
    parallel_seed_test(lambda: parallel_env(task), num_cycles=200)


@pytest.mark.parametrize("task", NAMES)
def test_it_plays_the_same_world_as_the_environment_itself(task: str) -> None:
    adapter, env = parallel_env(task), make(task)
    state = env.init(np.array([11], np.uint64))
    observations, infos = adapter.reset(seed=11)
    policy = scripted.make("scripted:random")
    while adapter.agents:
        assert np.array_equal(np.stack(list(observations.values())), env.observe(state)[0])
        assert [info["alive"] for info in infos.values()] == env.alive(state)[0].tolist()
        assert all(adapter.observation_space(agent).contains(seen) for agent, seen in observations.items())
        row = policy.actions(env, state)
        state, paid = env.step(state, row)
        taken = dict(zip(adapter.agents, row[0].tolist(), strict=True))
        observations, rewards, _, _, infos = adapter.step(taken)
        assert list(rewards.values()) == paid[0].tolist()
    assert env.done(state)[0]


def test_a_found_child_terminates_and_the_last_step_truncates() -> None:
    walks = {"oracle": (True, False), "always-up": (False, True)}
    for walk, (terminated, truncated) in walks.items():
        adapter = parallel_env("parent_child")
        adapter.reset(seed=5)
        while adapter.agents:
            oracle = scripted.make("scripted:oracle").actions(adapter.env, adapter._state)[0, 0]
            action = int(oracle) if walk == "oracle" else 4
            _, _, ends, cuts, _ = adapter.step({"seat_0": action, "seat_1": 4})
        assert set(ends.values()) == {terminated}
        assert set(cuts.values()) == {truncated}


def test_resets_without_a_seed_go_on_from_the_last_seed() -> None:
    one, other = parallel_env("parent_child"), parallel_env("parent_child")
    firsts = [env.reset(seed=3)[0]["seat_0"] for env in (one, other)]
    seconds = [env.reset()[0]["seat_0"] for env in (one, other)]
    third = one.reset()[0]["seat_0"]

    assert np.array_equal(*firsts)
    assert np.array_equal(*seconds)
    assert not np.array_equal(seconds[0], third)


def test_two_adapters_that_were_never_seeded_differ() -> None:
    worlds = {parallel_env("parent_child").reset()[0]["seat_0"].tobytes() for _ in range(8)}

    assert len(worlds) > 1


def test_an_agent_without_an_action_takes_the_first_one() -> None:
    worlds = []
    for actions in ({}, {"seat_0": 0, "seat_1": 0}):
        adapter = parallel_env("parent_child")
        adapter.reset(seed=4)
        worlds.append(adapter.step(actions)[0]["seat_0"])

    assert np.array_equal(*worlds)


def test_a_step_without_an_episode_is_refused() -> None:
    with pytest.raises(RuntimeError, match="call reset"):
        parallel_env("parent_child").step({})
