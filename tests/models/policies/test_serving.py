import numpy as np
import pytest

from models.policies.api import GeneratorDraws
from models.policies.recurrent import Architecture, RecurrentNet, RecurrentPolicy
from models.policies.serving import ServingPolicy, serving

KINDS = [("prototype", "learned"), ("prototype", "open"), ("one-hot", "open"), ("one-hot", "learned")]


def whole(channel: str, gate: str) -> RecurrentPolicy:
    import torch

    torch.manual_seed(7)
    sizes = Architecture(
        observation_size=55, actions=3, hidden=24, message=12, tokens=12, channel=channel, gate=gate
    )
    net = RecurrentNet(sizes)
    with torch.no_grad():
        net.speech[2].weight.mul_(20)  # so that more than one token is in use
    return RecurrentPolicy(net)


@pytest.mark.parametrize(("channel", "gate"), KINDS)
def test_numpy_gives_what_torch_gives_over_many_steps(channel: str, gate: str) -> None:
    slow = whole(channel, gate)
    quick = serving(slow)
    assert isinstance(quick, ServingPolicy)
    draw = np.random.default_rng(3)
    memory = np.zeros((9, slow.hidden_size), np.float32)
    same, used = [], set()
    for _ in range(60):
        observation = draw.random((9, 55), dtype=np.float32)
        one, other = slow.speak(memory, observation), quick.speak(memory, observation)
        np.testing.assert_allclose(other.hidden, one.hidden, atol=2e-5)
        same += [*(one.token == other.token), *(one.gate == other.gate)]
        used |= set(one.token.tolist())
        inbox = draw.normal(size=(9, 12)).astype(np.float32)
        action, memory = slow.act(one.hidden, inbox)
        again, after = quick.act(one.hidden, inbox)
        np.testing.assert_allclose(after, memory, atol=2e-5)
        same += [*(action == again)]
    assert np.mean(same) > 0.999
    assert len(used) > 1


@pytest.mark.parametrize(("channel", "gate"), KINDS)
def test_messages_are_exactly_the_vectors_of_their_tokens(channel: str, gate: str) -> None:
    quick = serving(whole(channel, gate))
    said = quick.speak(np.zeros((5, quick.hidden_size), np.float32), np.ones((5, 55), np.float32))
    np.testing.assert_array_equal(said.message, quick.vector(said.token))
    assert (said.token.dtype, said.gate.dtype) == (np.int32, np.bool_)


def test_nothing_that_goes_in_is_changed() -> None:
    quick = serving(whole("prototype", "learned"))
    memory = np.full((3, quick.hidden_size), 0.25, np.float32)
    quick.speak(memory, np.ones((3, 55), np.float32))
    quick.act(memory, np.ones((3, 12), np.float32))
    assert (memory == 0.25).all()


def test_large_numbers_raise_no_warning() -> None:
    quick = serving(whole("prototype", "learned"))
    memory = np.full((2, quick.hidden_size), 1e4, np.float32)
    quick.act(
        quick.speak(memory, np.full((2, 55), -1e4, np.float32)).hidden, np.full((2, 12), 1e4, np.float32)
    )


def test_sampling_is_left_to_torch() -> None:
    slow = whole("one-hot", "learned")
    quick = serving(slow)
    memory, seen = np.zeros((4, slow.hidden_size), np.float32), np.ones((4, 55), np.float32)
    assert (
        slow.speak(memory, seen, GeneratorDraws(5)).token
        == quick.speak(memory, seen, GeneratorDraws(5)).token
    ).all()


def test_other_policies_are_served_as_they_are() -> None:
    other = object()
    assert serving(other) is other  # type: ignore[arg-type, comparison-overlap]
