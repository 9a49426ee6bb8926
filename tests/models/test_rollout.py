"""What a rollout counts: who lived, what was said in which state, and how a participant's trial would end."""

import numpy as np
import pytest
import torch

from models import rollout
from models.envs import registry
from models.envs.traffic_junction import BRAKE, GAS
from models.policies.api import GeneratorDraws
from models.policies.recurrent import Architecture, RecurrentNet, RecurrentPolicy
from models.policies.team import Team
from models.vocabulary import SILENT


class Always:
    def __init__(self, action):
        self.action = action
        self.name = f"always-{action}"

    def actions(self, env, state):
        return np.full(env.alive(state).shape, self.action, np.int32)


def seeds(count):
    return np.arange(count, dtype=np.uint64)


def team(env, seed=0, sampled=None, gate="learned"):
    torch.manual_seed(seed)
    sizes = Architecture(env.observation_size, env.actions, 8, 4, 5, "prototype", gate)
    return Team(env, RecurrentPolicy(RecurrentNet(sizes)), sampled)


@pytest.fixture
def crossing():
    return registry.make("traffic_junction/medium")


def test_tokens_and_gates_stand_only_where_somebody_lives(crossing):
    played = rollout.episodes(crossing, team(crossing), seeds(8), arrival=0.2)
    assert played.alive.any()
    assert (played.tokens[~played.alive] == SILENT).all()
    assert not played.gates[~played.alive].any()
    assert (played.cells[~played.alive] == -1).all()
    assert (played.cells[played.alive] >= 0).all()
    assert 0 <= played.message_rate <= 1


def test_an_episode_is_the_same_alone_and_in_a_batch(crossing):
    together = rollout.episodes(crossing, team(crossing), seeds(5), "human")
    alone = rollout.episodes(crossing, team(crossing), seeds(5)[3:4], "human")
    assert np.array_equal(together.actions[:, 3:4], alone.actions)
    assert np.array_equal(together.tokens[:, 3:4], alone.tokens)
    assert np.array_equal(together.cells[:, 3:4], alone.cells)


def test_a_human_start_has_five_to_nine_other_cars(crossing):
    played = rollout.episodes(crossing, Always(GAS), seeds(60), "human")
    assert set(played.cars - 1) == {5, 6, 7, 8, 9}


def test_who_only_brakes_neither_arrives_nor_moves(crossing):
    played = rollout.episodes(crossing, Always(BRAKE), seeds(20), "human", arrival=0.0)
    judged = rollout.trials(played)
    assert not judged.arrived.any()
    assert not judged.collided.any()
    assert (judged.steps == 40).all()


def test_a_participants_trial_ends_at_the_first_collision_or_at_home(crossing):
    played = rollout.episodes(crossing, Always(GAS), seeds(300), "human")
    judged = rollout.trials(played)
    assert (judged.arrived ^ judged.collided).all()
    for episode in range(300):
        last = judged.steps[episode]
        hit, home = played.collided[:, episode, -1], played.completed[:, episode, -1]
        assert not hit[:last].any()
        assert not home[:last].any()
        assert hit[last] == judged.collided[episode]
        assert home[last] == judged.arrived[episode]
    assert 0.05 < judged.collided.mean() < 0.2
    assert judged.others.any()


def test_an_own_collision_is_no_collision_of_others(crossing):
    played = rollout.episodes(crossing, Always(GAS), seeds(300), "human")
    judged = rollout.trials(played)
    among_others = 0
    for episode in np.flatnonzero(judged.collided):
        last = judged.steps[episode]
        cars = played.collided[: last + 1, episode, :-1].sum(1)
        among_others += bool((cars[:-1] >= 2).any() or cars[-1] >= 2)
    assert among_others == judged.others[judged.collided].sum()


def test_masked_messages_are_neither_counted_nor_heard(crossing):
    player = team(crossing, gate="open")
    heard = rollout.episodes(crossing, player, seeds(30), arrival=0.2)
    masked = rollout.episodes(crossing, player, seeds(30), arrival=0.2, masked=True)
    assert heard.message_rate == 1
    assert masked.message_rate == 0
    assert not masked.gates.any()


def test_sampled_play_comes_again_from_its_seed(crossing):
    one, other = (
        rollout.episodes(crossing, team(crossing, sampled=GeneratorDraws(4)), seeds(4)) for _ in range(2)
    )
    greedy = rollout.episodes(crossing, team(crossing), seeds(4))
    assert np.array_equal(one.actions, other.actions)
    assert not np.array_equal(one.actions, greedy.actions)


def test_steps_count_until_the_child_is_found():
    env = registry.make("parent_child")
    played = rollout.episodes(env, team(env), seeds(40))
    assert ((played.steps == 20) | played.success).all()
    assert np.array_equal(played.alive[:, :, 0].sum(0), played.steps)
    assert not played.collided.any()


def test_traffic_questions_are_refused_where_there_is_none():
    env = registry.make("parent_child")
    for asked in ({"start": "human"}, {"arrival": 0.1}):
        with pytest.raises(ValueError, match="parent_child has no traffic"):
            rollout.episodes(env, team(env), seeds(2), **asked)
