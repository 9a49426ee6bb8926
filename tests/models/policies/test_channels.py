"""Channels and gate: what is sent, and which way the gradient takes."""

import pytest
import torch

from models.policies.channels import (
    COMMITMENT,
    ContinuousChannel,
    NoChannel,
    OneHotChannel,
    PrototypeChannel,
    gate_of,
    make_channel,
    pick,
)


def prototypes(*rows: list[float]) -> PrototypeChannel:
    channel = PrototypeChannel(len(rows), len(rows[0]))
    with torch.no_grad():
        channel.codebook.copy_(torch.tensor(rows))
    return channel


def test_a_prototype_message_is_the_nearest_vector_of_the_codebook():
    channel = prototypes([0.0, 0.0], [1.0, 1.0])
    said = channel(torch.tensor([[0.9, 0.8], [0.1, 0.2]]))
    assert said.token.tolist() == [1, 0]
    assert torch.allclose(said.message, torch.tensor([[1.0, 1.0], [0.0, 0.0]]))


def test_between_two_prototypes_equally_near_the_lower_index_is_said():
    channel = prototypes([1.0, 0.0], [-1.0, 0.0], [1.0, 0.0])
    assert channel(torch.tensor([[0.0, 0.0], [1.0, 0.0]])).token.tolist() == [0, 0]


def test_the_gradient_of_a_prototype_message_reaches_the_speaker_unchanged():
    channel = prototypes([0.0, 0.0], [1.0, 1.0])
    raw = torch.tensor([[0.9, 0.7]], requires_grad=True)
    (channel(raw).message * torch.tensor([[3.0, -2.0]])).sum().backward()
    assert raw.grad is not None
    assert raw.grad.tolist() == [[3.0, -2.0]]
    assert channel.codebook.grad is None or not channel.codebook.grad.any()


def test_upkeep_pulls_the_prototype_to_the_speaker_and_the_speaker_less_to_the_prototype():
    channel = prototypes([0.0, 0.0])
    raw = torch.tensor([[1.0, 2.0]], requires_grad=True)
    loss = channel(raw).loss.sum()
    assert loss.item() == pytest.approx(5 * (1 + COMMITMENT))
    loss.backward()
    assert raw.grad is not None
    assert channel.codebook.grad is not None
    assert raw.grad.tolist() == [[2 * COMMITMENT, 4 * COMMITMENT]]
    assert channel.codebook.grad.tolist() == [[-2.0, -4.0]]


def test_a_one_hot_message_names_the_largest_logit_and_learns_by_softmax():
    raw = torch.tensor([[0.0, 2.0, 2.0]], requires_grad=True)
    said = OneHotChannel()(raw)
    assert said.token.tolist() == [1]
    assert torch.allclose(said.message, torch.tensor([[0.0, 1.0, 0.0]]))
    said.message[0, 1].backward()
    assert raw.grad is not None
    soft = torch.softmax(raw.detach(), 1)[0]
    assert raw.grad[0, 1].item() == pytest.approx(float(soft[1] * (1 - soft[1])))


def test_one_hot_tokens_are_drawn_by_their_probability_when_draws_are_given():
    raw = torch.log(torch.tensor([[0.2, 0.5, 0.3]])).expand(4, 3)
    draws = torch.tensor([0.1, 0.25, 0.69, 0.99])
    assert OneHotChannel()(raw, draws).token.tolist() == [0, 1, 1, 2]


def test_a_draw_beyond_rounding_still_picks_something():
    assert pick(torch.tensor([[0.3, 0.3, 0.3999]]), torch.tensor([0.99999])).tolist() == [2]


def test_continuous_messages_pass_unchanged_and_no_channel_says_nothing():
    raw = torch.tensor([[0.5, -0.5]])
    assert torch.equal(ContinuousChannel()(raw).message, raw)
    assert ContinuousChannel()(raw).token.tolist() == [-1]
    assert not NoChannel()(raw).message.any()


def test_a_gate_opens_at_zero_and_learns_by_its_probability():
    logit = torch.tensor([-0.1, 0.0, 3.0], requires_grad=True)
    gate = gate_of(logit, None)
    assert gate.tolist() == [0.0, 1.0, 1.0]
    gate.sum().backward()
    chance = torch.sigmoid(logit.detach())
    assert logit.grad is not None
    assert torch.allclose(logit.grad, chance * (1 - chance))


def test_a_drawn_gate_is_open_as_often_as_its_probability_says():
    logit = torch.zeros(4)
    assert gate_of(logit, torch.tensor([0.1, 0.49, 0.51, 0.9])).tolist() == [1.0, 1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("kind", "tokens", "size", "reason"),
    [
        ("prototype", 0, 4, "at least one"),
        ("one-hot", 3, 4, "as long as"),
        ("smoke", 1, 1, "unknown channel"),
    ],
)
def test_a_channel_that_cannot_be_is_refused(kind, tokens, size, reason):
    with pytest.raises(ValueError, match=reason):
        make_channel(kind, tokens, size)
