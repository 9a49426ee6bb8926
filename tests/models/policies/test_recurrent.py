"""The recurrent policy: rows do not touch each other, shapes are checked, draws are used as promised."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from models.policies.api import GeneratorDraws
from models.policies.recurrent import Architecture, RecurrentNet, RecurrentPolicy

SMALL = Architecture(
    observation_size=7, actions=3, hidden=8, message=4, tokens=5, channel="prototype", gate="learned"
)


def policy(architecture: Architecture = SMALL, seed: int = 0) -> RecurrentPolicy:
    torch.manual_seed(seed)
    return RecurrentPolicy(RecurrentNet(architecture))


def rows(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    shapes = ((count, 40), (count, 7), (count, 4))
    hidden, observation, inbox = (generator.normal(size=shape).astype(np.float32) for shape in shapes)
    return hidden, observation, inbox


def test_a_batch_and_single_rows_agree():
    mind = policy()
    hidden, observation, inbox = rows(6)
    together = mind.speak(hidden, observation)
    actions, after = mind.act(together.hidden, inbox)
    for row in range(6):
        one = slice(row, row + 1)
        alone = mind.speak(hidden[one], observation[one])
        action, later = mind.act(alone.hidden, inbox[one])
        assert alone.token == together.token[row]
        assert alone.gate == together.gate[row]
        assert action == actions[row]
        np.testing.assert_allclose(later[0], after[row], atol=1e-5)


def test_no_rows_are_no_trouble():
    mind = policy()
    said = mind.speak(*rows(0)[:2])
    action, after = mind.act(said.hidden, np.zeros((0, 4), np.float32))
    assert said.token.shape == action.shape == (0,)
    assert after.shape == (0, mind.hidden_size)


def test_a_prototype_message_is_bit_for_bit_the_vector_of_its_token():
    mind = policy()
    said = mind.speak(*rows(20)[:2])
    assert np.array_equal(said.message, mind.vector(said.token))
    assert np.array_equal(mind.vector(np.array([-1], np.int32)), np.zeros((1, 4), np.float32))
    assert mind.codebook.shape == (5, 4)


@pytest.mark.parametrize("channel", ["continuous", "none", "prototype", "one-hot"])
def test_every_channel_speaks_in_its_own_way(channel):
    tokens = {"prototype": 5, "one-hot": 4}.get(channel, 0)
    mind = policy(replace(SMALL, channel=channel, tokens=tokens, gate="open"))
    said = mind.speak(*rows(9)[:2])
    assert said.gate.all() == (channel != "none")
    assert (said.token >= 0).all() == (tokens > 0)
    if channel == "one-hot":
        assert np.array_equal(said.message, np.eye(4, dtype=np.float32)[said.token])
    if channel == "none":
        assert not said.message.any()


def test_an_open_gate_is_open_whatever_is_drawn():
    mind = policy(replace(SMALL, gate="open"))
    assert mind.speak(*rows(50)[:2], GeneratorDraws(3)).gate.all()


def test_sampled_actions_differ_from_greedy_ones_and_come_again_from_the_same_seed():
    mind = policy()
    hidden, observation, inbox = rows(200)
    said = mind.speak(hidden, observation)
    greedy, _ = mind.act(said.hidden, inbox)
    drawn, _ = mind.act(said.hidden, inbox, GeneratorDraws(1))
    again, _ = mind.act(said.hidden, inbox, GeneratorDraws(1))
    assert (drawn != greedy).any()
    assert np.array_equal(drawn, again)


def test_weights_make_the_same_policy_again():
    mind = policy()
    twin = RecurrentPolicy.from_weights(SMALL, mind.weights())
    hidden, observation, inbox = rows(10)
    one, other = mind.speak(hidden, observation), twin.speak(hidden, observation)
    assert np.array_equal(one.hidden, other.hidden)
    assert np.array_equal(mind.act(one.hidden, inbox)[1], twin.act(other.hidden, inbox)[1])


def test_weights_that_do_not_fit_are_refused_by_name():
    weights = policy().weights()
    with pytest.raises(ValueError, match=r"channel\.codebook has shape \(5, 4\), not \(6, 4\)"):
        RecurrentPolicy.from_weights(replace(SMALL, tokens=6), weights)
    with pytest.raises(ValueError, match=r"gate\.0\.bias is missing or unknown"):
        RecurrentPolicy.from_weights(replace(SMALL, gate="open"), weights)


def test_raw_vectors_are_sent_before_quantisation():
    torch.manual_seed(0)
    raw = RecurrentPolicy(RecurrentNet(SMALL), discrete=False, open_gate=True)
    said = raw.speak(*rows(5)[:2])
    assert said.gate.all()
    assert not np.array_equal(said.message, raw.vector(said.token))


def test_what_is_heard_changes_what_is_done():
    mind = policy()
    said = mind.speak(*rows(1)[:2])
    quiet = mind.act(said.hidden, np.zeros((1, 4), np.float32))[1]
    loud = mind.act(said.hidden, np.ones((1, 4), np.float32))[1]
    assert not np.allclose(quiet, loud)


@pytest.mark.parametrize(("field", "value"), [("gate", "ajar"), ("hidden", 0), ("actions", 0)])
def test_sizes_that_cannot_be_are_refused(field, value):
    with pytest.raises(ValueError, match=r"gate|at least 1"):
        replace(SMALL, **{field: value})
