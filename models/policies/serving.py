"""The same weights without torch's overhead, for a handful of rows at a time.

A step of a trial asks for at most ten rows. There torch spends nearly all of its time on being called; the
same arithmetic in numpy, with neighbouring layers joined into one matrix product, takes a fraction. Results
agree with torch to rounding, so that now and then a near-tie is decided otherwise: what was decided is
recorded (DESIGN section 3), and evaluation keeps to torch.

Shapes: R rows, O observation, H hidden, D message, K tokens.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, nn

from models.policies.api import Policy, RandomDraws, Speech
from models.policies.recurrent import RecurrentPolicy

Floats = NDArray[np.float32]


class Layer(NamedTuple):
    """x @ weight + bias, the weight (in, out)."""

    weight: Floats
    bias: Floats

    def __call__(self, x: Floats) -> Floats:
        y: Floats = x @ self.weight
        y += self.bias
        return y


def serving(policy: Policy) -> Policy:
    """The policy, made quick for few rows where it can be."""
    return ServingPolicy(policy) if isinstance(policy, RecurrentPolicy) else policy


class ServingPolicy:
    """A released `RecurrentPolicy`, greedy, in numpy. Sampling is left to torch."""

    def __init__(self, policy: RecurrentPolicy) -> None:
        net, sizes = policy.net, policy.architecture
        self.policy = policy
        self.channel, self.tokens = policy.channel, policy.tokens
        self.message_size, self.hidden_size = policy.message_size, policy.hidden_size
        self._width = sizes.hidden
        self._one_hot = sizes.channel == "one-hot"
        self._see = beside(layer(net.encoder.plain), layer(net.encoder.wave))
        self._join = layer(net.encoder.join)
        self._first, self._second = recurrent(net.first), recurrent(net.second)
        self._talk = layer(net.speech[0])
        self._gate = None if net.gate is None else (layer(net.gate[0]), layer(net.gate[2]))
        self._word = layer(net.speech[2])
        self._inbox, self._own = layer(net.match_inbox), layer(net.match_own)
        self._think, self._choose = layer(net.head[0]), layer(net.head[2])
        self._codebook = policy.codebook.T.copy()  # (D, K)
        self._squares = np.square(policy.codebook).sum(1)  # (K,)

    def speak(self, hidden: Floats, observation: Floats, sampled: RandomDraws | None = None) -> Speech:
        if sampled is not None:
            return self.policy.speak(hidden, observation, sampled)
        width = self._width
        seen = self._see(observation)  # (R, 2H)
        np.maximum(seen[:, :width], 0, out=seen[:, :width])
        np.sin(seen[:, width:], out=seen[:, width:])
        memory = hidden.copy()
        encoded = memory[:, 4 * width :]
        np.tanh(self._join(seen), out=encoded)
        hidden1, cell1 = memory[:, :width], memory[:, width : 2 * width]
        remember(self._first(np.concatenate((encoded, hidden1), 1)), hidden1, cell1)
        source = np.concatenate((hidden1, encoded), 1)  # (R, 2H)
        raw = self._word(np.maximum(self._talk(source), 0))  # (R, D)
        token = self._nearest(raw)
        gate = self._opens(np.concatenate((source, memory[:, 2 * width : 3 * width]), 1))
        return Speech(token, gate, self.vector(token), memory)

    def act(
        self, hidden: Floats, inbox: Floats, sampled: RandomDraws | None = None
    ) -> tuple[NDArray[np.int32], Floats]:
        if sampled is not None:
            return self.policy.act(hidden, inbox, sampled)
        width = self._width
        memory = hidden.copy()
        hidden1, encoded = memory[:, :width], memory[:, 4 * width :]
        hidden2, cell2 = memory[:, 2 * width : 3 * width], memory[:, 3 * width : 4 * width]
        remember(self._second(np.concatenate((hidden1, inbox, hidden2), 1)), hidden2, cell2)
        match = self._inbox(inbox) * self._own(encoded)
        features = np.concatenate((hidden2, inbox, encoded, match), 1)
        logits = self._choose(np.maximum(self._think(features), 0))
        return logits.argmax(1).astype(np.int32), memory

    def vector(self, tokens: NDArray[np.int32]) -> Floats:
        return self.policy.vector(tokens)

    def _opens(self, known: Floats) -> NDArray[np.bool_]:
        if self._gate is None:
            return np.ones(len(known), np.bool_)
        weigh, decide = self._gate
        opens: NDArray[np.bool_] = decide(np.maximum(weigh(known), 0))[:, 0] >= 0
        return opens

    def _nearest(self, raw: Floats) -> NDArray[np.int32]:
        near = raw if self._one_hot else 2 * np.tanh(raw) @ self._codebook - self._squares
        token: NDArray[np.int32] = near.argmax(1).astype(np.int32)
        return token


def remember(gates: Floats, hidden: Floats, cell: Floats) -> None:
    """One LSTM step, in place: gates (R, 4H) in torch's order, input, forget, candidate, output."""
    width = hidden.shape[1]
    np.tanh(gates, out=gates)
    candidate = gates[:, 2 * width : 3 * width].copy()
    gates += 1
    gates *= 0.5  # sigmoid(x) = (1 + tanh(x / 2)) / 2; `recurrent` has halved x
    cell *= gates[:, width : 2 * width]
    cell += gates[:, :width] * candidate
    np.multiply(gates[:, 3 * width :], np.tanh(cell), out=hidden)


def array(tensor: Tensor) -> Floats:
    values: Floats = tensor.detach().numpy()
    return values


def layer(linear: Any) -> Layer:
    return Layer(array(linear.weight).T.copy(), array(linear.bias).copy())


def beside(one: Layer, other: Layer) -> Layer:
    """Two layers on one input, as one."""
    return Layer(np.hstack((one.weight, other.weight)), np.hstack((one.bias, other.bias)))


def recurrent(cell: nn.LSTMCell) -> Layer:
    """An LSTM cell's gates as one layer on (input, hidden), those of a sigmoid halved (`remember`)."""
    half = np.repeat(np.array([0.5, 0.5, 1.0, 0.5], np.float32), cell.hidden_size)
    weight = np.vstack((array(cell.weight_ih).T, array(cell.weight_hh).T))
    return Layer(weight * half, (array(cell.bias_ih) + array(cell.bias_hh)) * half)
