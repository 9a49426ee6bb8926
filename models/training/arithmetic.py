"""The arithmetic of ``RecurrentNet`` as training does it: same weights and values up to rounding, less work.

- Agents in the same place see the same, so equal observations are encoded once, with all that is linear in
  them: their part of the first LSTM's gates, of the speech and of the match.
- An LSTM is one matrix product and one node of the graph, whose gradient is written out.
- Memories are gathered from the rows of the last step, of which each has one successor at most: their
  gradient is gathered too, never summed.

What these functions compute is compared with ``RecurrentNet``, value and gradient, in
``tests/models/training/test_arithmetic.py``. Shapes: R rows, U different observations, O observation, H
hidden, D message, S source of an LSTM.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from models.policies.recurrent import Done, Memory, RecurrentNet, Said

FORGOTTEN = -1
"""The row of a seat that remembers nothing."""

sigmoid_slope = torch.ops.aten.sigmoid_backward.grad_input
tanh_slope = torch.ops.aten.tanh_backward


class Spoken(NamedTuple):
    """What was said, and the part of the match that only depends on the own observation, (R, H)."""

    said: Said
    own: Tensor


class Arithmetic:
    """The weights, arranged once for all steps of an unroll."""

    def __init__(self, net: RecurrentNet) -> None:
        self.net = net
        one, two, speech = net.first, net.second, net.speech[0]
        assert isinstance(speech, nn.Linear)
        self._bias1 = one.bias_ih + one.bias_hh
        self._bias2 = two.bias_ih + two.bias_hh
        self._weight2 = torch.cat((two.weight_ih, two.weight_hh), 1)  # (4H, H + D + H)
        self._speech = speech.weight.split(net.architecture.hidden, 1)  # type: ignore[no-untyped-call]
        self._speech_bias = speech.bias

    def speak(
        self, memory: Memory, seen: "Seen", draws: Tensor | None = None, *, discrete: bool = True
    ) -> Spoken:
        """As ``RecurrentNet.speak``."""
        net, linear = self.net, nn.functional.linear
        encoded = net.encoder(seen.different)  # (U, H)
        gates = linear(encoded, net.first.weight_ih, self._bias1)  # (U, 4H)
        from_hidden, from_encoded = self._speech
        spoken = linear(encoded, from_encoded, self._speech_bias)
        parts = torch.cat((encoded, net.match_own(encoded), spoken), 1).index_select(0, seen.which)
        encoded, own, spoken = parts.split(net.architecture.hidden, 1)  # type: ignore[no-untyped-call]  # (R, H) each
        hidden1, cell1 = Cell.apply(memory.hidden1, memory.cell1, net.first.weight_hh, gates, seen.which)  # type: ignore[no-untyped-call]
        raw = net.speech[2](torch.addmm(spoken, hidden1, from_hidden.t()).relu())
        after = memory._replace(hidden1=hidden1, cell1=cell1)
        return Spoken(net.utter(raw, after, encoded, draws, discrete=discrete), own)

    def act(self, spoken: Spoken, inbox: Tensor) -> Done:
        """As ``RecurrentNet.act``."""
        net, (said, own) = self.net, spoken
        memory = said.memory
        source = torch.cat((memory.hidden1, inbox, memory.hidden2), 1)
        hidden2, cell2 = Cell.apply(source, memory.cell2, self._weight2, self._bias2, None)  # type: ignore[no-untyped-call]
        match = net.match_inbox(inbox) * own
        features = torch.cat((hidden2, inbox, said.encoded, match), 1)
        return Done(net.head(features), memory._replace(hidden2=hidden2, cell2=cell2), features)


class Seen(NamedTuple):
    """Observations (R, O) as the different ones among them."""

    different: Tensor
    """(U, O)"""
    which: Tensor
    """(R,) int64"""


def distinct(observation: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (U,) of the different ones among observations (R, O), and which of them each (R,) is.

    Rows are told apart by one random projection. Where two different rows share it, all count as different.
    """
    key = np.einsum("ro,o->r", observation, _projection(observation.shape[1]))  # BLAS rounds equal rows apart
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    if (observation[first][which] == observation).all():
        return first, which
    every = np.arange(len(observation))
    return every, every


@cache
def _projection(size: int) -> NDArray[np.float64]:
    return np.random.default_rng(size).standard_normal(size)


class Cell(torch.autograd.Function):
    """One step of an LSTM: hidden and cell (R, H) from source (R, S), cell (R, H), weight (4H, S) and base.

    The base of the gates is a bias (4H,), or rows (U, 4H) of which ``which`` (R,) says whose is whose.
    """

    @staticmethod
    def forward(
        ctx: Any, source: Tensor, cell: Tensor, weight: Tensor, base: Tensor, which: Tensor | None
    ) -> tuple[Tensor, Tensor]:
        if which is None:
            gates = torch.addmm(base, source, weight.t())
        else:
            gates = base.index_select(0, which).addmm_(source, weight.t())
        size = cell.shape[1]
        new = gates[:, 2 * size : 3 * size].mul_(2)  # tanh(x) = 2 sigmoid(2 x) - 1, at a third of its price
        gates.sigmoid_()
        new.mul_(2).sub_(1)
        into, kept, _, out = gates.chunk(4, 1)
        after = (kept * cell).addcmul_(into, new)
        bent = (2 * after).sigmoid_().mul_(2).sub_(1)
        ctx.save_for_backward(source, cell, weight, gates, bent, which)
        ctx.rows = len(base)
        return out * bent, after

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor | None, ...]:
        source, cell, weight, gates, bent, which = ctx.saved_tensors
        into, kept, new, out = gates.chunk(4, 1)
        d_hidden, d_after = slopes
        d_cell = tanh_slope(d_hidden * out, bent).add_(d_after)
        d_gates = torch.empty_like(gates)
        d_into, d_kept, d_new, d_out = d_gates.chunk(4, 1)
        sigmoid_slope(d_cell * new, into, grad_input=d_into)
        sigmoid_slope(d_cell * cell, kept, grad_input=d_kept)
        tanh_slope.grad_input(d_cell * into, new, grad_input=d_new)
        sigmoid_slope(d_hidden * bent, out, grad_input=d_out)
        d_source = d_gates @ weight if ctx.needs_input_grad[0] else None
        d_base = (
            d_gates.sum(0)
            if which is None
            else d_gates.new_zeros(ctx.rows, d_gates.shape[1]).index_add_(0, which, d_gates)
        )
        return d_source, d_cell.mul_(kept), d_gates.t() @ source, d_base, None


class Recall(torch.autograd.Function):
    """Rows (R, H) of tensors (P, H), zeros where the row is FORGOTTEN; no row is asked for twice."""

    @staticmethod
    def forward(ctx: Any, row: Tensor, fresh: Tensor, successor: Tensor, last: Tensor, *parts: Tensor) -> Any:
        """Gather.

        Args:
            ctx: of autograd.
            row: (R,) which one is wanted, anything where ``fresh``.
            fresh: indices of the R that get zeros.
            successor: (P,) who wants it, anything where ``last``.
            last: indices of the P that nobody wants.
            parts: what is gathered.
        """
        ctx.save_for_backward(successor, last)
        return tuple(_gathered(part, row, fresh) for part in parts)

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor | None, ...]:
        successor, last = ctx.saved_tensors
        return None, None, None, None, *(_gathered(slope, successor, last) for slope in slopes)


def _gathered(rows: Tensor, which: Tensor, none: Tensor) -> Tensor:
    """Rows (W, H) of (R, H), zeros at the indices ``none``; all zeros where there are no rows."""
    if not len(rows):
        return rows.new_zeros(len(which), *rows.shape[1:])
    return rows.index_select(0, which).index_fill_(0, none, 0)
