"""Training's arithmetic is that of the policy, in value and gradient, up to rounding."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from models.policies.recurrent import Architecture, Memory, RecurrentNet
from models.training.arithmetic import Arithmetic, Cell, Recall, Seen, distinct

ROWS, DIFFERENT, OBSERVATION, HIDDEN, MESSAGE = 40, 7, 9, 12, 6
KINDS = [
    (channel, gate)
    for channel in ("none", "continuous", "prototype", "one-hot")
    for gate in ("open", "learned")
]
ROUNDING = 2e-6
"""Of float32, relative to the largest of a tensor: some twenty units in the last place."""


def net_of(channel: str, gate: str) -> RecurrentNet:
    torch.manual_seed(7)
    tokens = MESSAGE if channel in ("prototype", "one-hot") else 0
    return RecurrentNet(Architecture(OBSERVATION, 3, HIDDEN, MESSAGE, tokens, channel, gate))


def leaf(*shape: int) -> Tensor:
    return torch.randn(*shape, requires_grad=True)


def inputs() -> tuple[Memory, Tensor, Tensor, Tensor, Tensor]:
    """Memory, different observations, which is whose, draws, inbox."""
    torch.manual_seed(8)
    memory = Memory(*(leaf(ROWS, HIDDEN) for _ in Memory._fields))
    which = torch.randint(0, DIFFERENT, (ROWS,))
    return memory, torch.rand(DIFFERENT, OBSERVATION), which, torch.rand(ROWS, 2), leaf(ROWS, MESSAGE)


def outputs(said: Any, done: Any) -> list[Tensor]:
    return [said.message, said.gate, said.gate_logit, said.raw, said.loss, said.encoded, done.logits,
            *done.memory, done.features]  # fmt: skip


def plain(net: RecurrentNet, draws: Tensor | None) -> tuple[list[Tensor], Tensor, list[Tensor]]:
    memory, different, which, _, inbox = inputs()
    said = net.speak(memory, different[which], draws)
    done = net.act(said.memory, said.encoded, inbox)
    return outputs(said, done), said.token, slopes(net, outputs(said, done), memory, inbox)


def arranged(net: RecurrentNet, draws: Tensor | None) -> tuple[list[Tensor], Tensor, list[Tensor]]:
    memory, different, which, _, inbox = inputs()
    work = Arithmetic(net)
    spoken = work.speak(memory, Seen(different, which), draws)
    done = work.act(spoken, inbox)
    return (
        outputs(spoken.said, done),
        spoken.said.token,
        slopes(net, outputs(spoken.said, done), memory, inbox),
    )


def slopes(net: RecurrentNet, given: list[Tensor], memory: Memory, inbox: Tensor) -> list[Tensor]:
    """Gradient of a random mixture of all outputs, to weights, memory and inbox."""
    torch.manual_seed(9)
    mixture = torch.stack([(one * torch.randn_like(one)).sum() for one in given if one.requires_grad]).sum()
    wanted = [*net.parameters(), *memory, inbox]
    found = torch.autograd.grad(mixture, wanted, allow_unused=True)
    return [torch.zeros(()) if one is None else one for one in found]


def assert_near(one: Tensor, other: Tensor) -> None:
    assert one.shape == other.shape
    one, other = one.detach(), other.detach()
    assert float((one - other).abs().max()) <= ROUNDING * max(1.0, float(other.abs().max()))


@pytest.mark.parametrize(("channel", "gate"), KINDS)
@pytest.mark.parametrize("drawn", [False, True])
def test_values_and_gradients_are_those_of_the_policy(channel: str, gate: str, drawn: bool) -> None:
    net, draws = net_of(channel, gate), inputs()[3] if drawn else None
    values, token, gradients = arranged(net, draws)
    expected = plain(net, draws)
    assert torch.equal(token, expected[1])
    for one, other in zip(values, expected[0], strict=True):
        assert_near(one, other)
    assert len(gradients) == len(expected[2]) > 20
    assert sum(bool(other.any()) for other in expected[2]) > 20
    for one, other in zip(gradients, expected[2], strict=True):
        assert_near(one, other)


@pytest.mark.parametrize("shared", [False, True])
def test_the_gradient_of_a_cell_is_its_slope(shared: bool) -> None:
    """By finite differences, in double precision."""
    torch.manual_seed(3)
    parts = [
        torch.randn(*shape, dtype=torch.float64, requires_grad=True) for shape in ((5, 4), (5, 3), (12, 4))
    ]
    base = torch.randn(*((2, 12) if shared else (12,)), dtype=torch.float64, requires_grad=True)
    which = torch.tensor([0, 1, 1, 0, 1]) if shared else None
    assert torch.autograd.gradcheck(Cell.apply, (*parts, base, which))


def test_a_memory_is_recalled_once_and_its_gradient_goes_back_to_it() -> None:
    """Rows 2, 0 and nothing are wanted of three rows."""
    part = torch.randn(3, 4, dtype=torch.float64, requires_grad=True)
    index = [torch.tensor(each) for each in ([2, 0, 0], [2], [1, 0, 0], [1])]
    (recalled,) = Recall.apply(*index, part)
    assert torch.equal(recalled, torch.stack((part[2], part[0], torch.zeros(4))))
    assert torch.autograd.gradcheck(lambda x: Recall.apply(*index, x), (part,))


@pytest.mark.parametrize(("wanted", "held"), [(0, 3), (3, 0)])
def test_a_step_without_anybody_recalls_nothing_and_is_recalled_by_nobody(wanted: int, held: int) -> None:
    """The last episode of a batch has ended before its last step, or the first car comes late."""
    part = torch.randn(held, 4, dtype=torch.float64, requires_grad=True)
    nobody = [torch.zeros(wanted, dtype=torch.long), torch.arange(wanted)]
    (recalled,) = Recall.apply(*nobody, torch.zeros(held, dtype=torch.long), torch.arange(held), part)
    assert torch.equal(recalled, torch.zeros(wanted, 4))
    (slope,) = torch.autograd.grad(recalled.sum(), part)
    assert torch.equal(slope, torch.zeros(held, 4))


@given(st.lists(st.integers(0, 5), min_size=1, max_size=30))
def test_equal_observations_are_found_whatever_their_order(kinds: list[int]) -> None:
    table = np.random.default_rng(1).integers(0, 2, (6, 11)).astype(np.float32)
    table[:, 0] = np.arange(6)
    observation = table[kinds]
    first, which = distinct(observation)
    assert (observation[first][which] == observation).all()
    assert len(first) == len(set(kinds))


def test_observations_that_the_projection_confuses_are_all_encoded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("models.training.arithmetic._projection", np.zeros)
    observation = np.eye(4, dtype=np.float32)
    first, which = distinct(observation)
    assert (observation[first][which] == observation).all()
    assert all(one < other for one, other in pairwise(first))


def test_nobody_sees_nothing() -> None:
    first, which = distinct(np.zeros((0, 5), np.float32))
    assert len(first) == len(which) == 0
