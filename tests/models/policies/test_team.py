"""The order of a step, who hears whom, and whose memory is fresh."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from models.envs import registry
from models.policies.api import Speech
from models.policies.recurrent import Architecture, RecurrentNet, RecurrentPolicy
from models.policies.team import Talk, Team
from models.vocabulary import SILENT


class Echo:
    """A policy whose memory counts its steps and whose action shows what it heard."""

    channel, tokens, message_size, hidden_size = "one-hot", 3, 3, 1

    def speak(self, hidden, observation, sampled=None):
        token = (hidden[:, 0].astype(np.int32)) % 3
        return Speech(token, np.ones(len(token), np.bool_), self.vector(token), hidden + 1)

    def act(self, hidden, inbox, sampled=None):
        return (inbox.sum(1) > 0).astype(np.int32), hidden

    def vector(self, tokens):
        return np.concatenate([np.eye(3), np.zeros((1, 3))])[tokens].astype(np.float32)


@pytest.fixture
def crossing():
    return registry.make("traffic_junction/medium")


@pytest.fixture
def search():
    return registry.make("parent_child")


def seeds(count):
    return np.arange(count, dtype=np.uint64)


def busy(env, batch=3, steps=12):
    """States with some cars."""
    state = replace(env.init(seeds(batch)), arrival_threshold=np.full(batch, 2**28, np.int64))
    for _ in range(steps):
        state, _ = env.step(state, np.zeros((batch, env.agents), np.int32))
    return state


def talk(tokens, gates):
    tokens = np.array([tokens], np.int32)
    gates = np.array([gates], np.bool_)
    return Talk(tokens, gates, Echo().vector(tokens))


def test_the_inbox_is_the_mean_of_what_the_others_sent(crossing):
    said = talk([0, 1, 1, 2] + [SILENT] * 6, [True, True, True, False] + [False] * 6)
    inbox = Team(crossing, Echo()).inbox(said)[0]
    np.testing.assert_allclose(inbox[0], [0, 1, 0])  # hears the two ones, not itself
    np.testing.assert_allclose(inbox[1], [0.5, 0.5, 0])
    np.testing.assert_allclose(inbox[3], [1 / 3, 2 / 3, 0])  # a closed gate still hears


def test_who_is_alone_or_hears_only_silence_gets_zeros(crossing):
    team = Team(crossing, Echo())
    alone = talk([2] + [SILENT] * 9, [True] + [False] * 9)
    assert not team.inbox(alone)[0, 0].any()
    assert not team.inbox(talk([2] * 10, [False] * 10)).any()


def test_only_the_living_speak_and_act(crossing):
    team, state = Team(crossing, Echo()), busy(crossing)
    said, memory = team.speak(state, team.start(3))
    alive = crossing.alive(state)
    assert 0 < alive.sum() < alive.size
    assert (said.tokens[~alive] == SILENT).all()
    assert not said.gates[~alive].any()
    assert not said.messages[~alive].any()
    assert said.gates[alive].all()
    assert not memory.hidden[~alive].any()
    actions, _ = team.act(state, memory, said)
    assert not actions[~alive].any()


def test_a_newcomer_remembers_nothing(crossing):
    team, state = Team(crossing, Echo()), busy(crossing, batch=12)
    old = team.start(12)._replace(hidden=np.full((12, 10, 1), 7, np.float32))
    _, memory = team.speak(state, old)
    fresh = crossing.fresh(state) & crossing.alive(state)
    settled = crossing.alive(state) & ~crossing.fresh(state)
    assert fresh.any()
    assert (memory.hidden[fresh] == 1).all()
    assert (memory.hidden[settled] == 8).all()


def test_an_empty_seat_changes_nothing_for_the_others(crossing):
    sizes = Architecture(crossing.observation_size, 2, 8, 4, 5, "prototype", "learned")
    torch.manual_seed(0)
    team, state = Team(crossing, RecurrentPolicy(RecurrentNet(sizes))), busy(crossing)
    alive = crossing.alive(state)
    clean = team.start(3)
    noisy = clean._replace(hidden=np.where(alive[:, :, None], clean.hidden, np.float32(9)))
    results = []
    for memory in (clean, noisy):
        said, spoken = team.speak(state, memory)
        actions, after = team.act(state, spoken, said)
        results.append((said.tokens[alive], said.gates[alive], actions[alive], after.hidden[alive]))
    for one, other in zip(*results, strict=True):
        assert np.array_equal(one, other)


def test_a_seat_that_may_not_speak_stays_silent(search):
    team, state = Team(search, Echo()), search.init(seeds(4))
    said, memory = team.speak(state, team.start(4))
    assert (said.tokens[:, 0] == SILENT).all()
    assert not said.gates[:, 0].any()
    assert said.gates[:, 1].all()
    assert (memory.hidden == 1).all()  # the silent seat observes and remembers all the same


def test_where_messages_are_held_the_first_is_heard_at_every_step(search):
    team, state = Team(search, Echo()), search.init(seeds(4))
    first, memory = team.speak(state, team.start(4))
    for _ in range(3):
        actions, memory = team.act(state, memory, first)
        state, _ = search.step(state, actions)
        again, memory = team.speak(state, memory)
        assert np.array_equal(again.tokens, first.tokens)  # Echo would say 1, 2, 0 by now
    assert (memory.hidden == 4).all()


def test_what_a_person_says_is_sent_and_held(search):
    team, state = Team(search, Echo()), search.init(seeds(2))
    said, memory = team.speak(state, team.start(2))
    chosen = team.say(said, 1, np.array([2, 1], np.int32))
    assert said.tokens[:, 1].tolist() == [0, 0]  # the old talk is left alone
    assert chosen.tokens[:, 1].tolist() == [2, 1]
    _, memory = team.act(state, memory, chosen)
    again, _ = team.speak(state, memory)
    assert again.tokens[:, 1].tolist() == [2, 1]
    np.testing.assert_allclose(team.inbox(again)[:, 0], [[0, 0, 1], [0, 1, 0]])


def test_silence_can_be_chosen_too(crossing):
    team = Team(crossing, Echo())
    quiet = team.say(talk([2] * 10, [True] * 10), 3, np.array([SILENT], np.int32))
    assert not quiet.gates[0, 3]
    assert not quiet.messages[0, 3].any()


def test_stored_tokens_and_gates_make_the_same_talk_again(crossing):
    team, state = Team(crossing, Echo()), busy(crossing)
    said, _ = team.speak(state, team.start(3))
    again = team.recorded(said.tokens, said.gates)
    for one, other in zip(said, again, strict=True):
        assert np.array_equal(one, other)
