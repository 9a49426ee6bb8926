"""The plain policy: one GRU in numpy, for weights that were trained in any framework.

    h   = GRU([observation, inbox of the last step], h)                  (``speak``)
    raw = speech h + bias;   gate open where gate h + bias >= 0
    a   = argmax act relu(think [h, inbox] + bias) + bias                (``act``)

with the gated recurrent unit of Cho et al. 2014, in the order and form of torch.nn.GRUCell: for x the input,

    [r, z, n] = weight_ih x + bias_ih,   [r', z', n'] = weight_hh h + bias_hh
    h = (1 - Z) tanh(n + R n') + Z h     where R = sigmoid(r + r'), Z = sigmoid(z + z').

The token is the prototype nearest to raw (ties: lowest index), or with one-hot messages the largest of raw;
listeners receive the prototype, or the one-hot vector. Weights (rows are outputs), O observation, H hidden, D
message, K tokens, A actions; with one-hot messages D = K:

    gru.weight_ih (3H, O + D)   gru.weight_hh (3H, H)   gru.bias_ih (3H)   gru.bias_hh (3H)
    speech.weight (D, H)        speech.bias (D)
    codebook (K, D)             prototype channel only
    gate.weight (1, H)          gate.bias (1)           learned gate only
    think.weight (H, H + D)     think.bias (H)
    act.weight (A, H)           act.bias (A)

Memory is [h, inbox], zeros for a newcomer. Drawn instead of greedy: a token of a one-hot channel by softmax
of raw, a gate with probability sigmoid, an action by softmax.
"""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.policies.api import RandomDraws, Speech
from models.policies.recurrent import Architecture
from models.policies.shapes import require

Floats = NDArray[np.float32]


class PlainPolicy:
    """A `Policy`; see the module docstring for what it computes."""

    def __init__(self, architecture: Architecture, weights: Mapping[str, Floats]) -> None:
        self.architecture = architecture
        self.channel, self.tokens = architecture.channel, architecture.tokens
        self.message_size = architecture.message
        self.hidden_size = architecture.hidden + architecture.message
        self._weights = dict(weights)
        one_hot = np.eye(self.tokens, dtype=np.float32)
        self.codebook = one_hot if self.channel == "one-hot" else self._weights["codebook"]  # (K, D)
        silent = np.zeros((1, self.message_size), np.float32)
        self._vectors = np.vstack((self.codebook, silent))  # SILENT (-1) points at the last

    @classmethod
    def from_weights(cls, architecture: Architecture, weights: Mapping[str, Tensor]) -> "PlainPolicy":
        """Build the policy around stored weights.

        Raises:
            ValueError: a weight is missing, unknown or of another shape.
        """
        require(shapes(architecture), weights)
        return cls(architecture, {name: tensor.detach().numpy() for name, tensor in weights.items()})

    def weights(self) -> dict[str, Tensor]:
        """What a bundle stores."""
        return {name: torch.from_numpy(values.copy()) for name, values in self._weights.items()}

    def speak(self, hidden: Floats, observation: Floats, sampled: RandomDraws | None = None) -> Speech:
        width = self.architecture.hidden
        before, heard = hidden[:, :width], hidden[:, width:]
        after = self._remember(np.concatenate((observation, heard), 1), before)
        token = self._token(self._layer("speech", after), sampled)
        memory = np.concatenate((after, heard), 1)
        return Speech(token, self._opens(after, sampled), self.vector(token), memory)

    def act(
        self, hidden: Floats, inbox: Floats, sampled: RandomDraws | None = None
    ) -> tuple[NDArray[np.int32], Floats]:
        memory = np.concatenate((hidden[:, : self.architecture.hidden], inbox), 1)
        logits = self._layer("act", np.maximum(self._layer("think", memory), 0))
        return _choice(logits, sampled), memory

    def vector(self, tokens: NDArray[np.int32]) -> Floats:
        return self._vectors[tokens]

    def _layer(self, name: str, x: Floats) -> Floats:
        y: Floats = x @ self._weights[f"{name}.weight"].T + self._weights[f"{name}.bias"]
        return y

    def _remember(self, x: Floats, before: Floats) -> Floats:
        """One step of the GRU: input (R, O + D), state (R, H)."""
        parts = self._weights
        seen = x @ parts["gru.weight_ih"].T + parts["gru.bias_ih"]  # (R, 3H)
        known = before @ parts["gru.weight_hh"].T + parts["gru.bias_hh"]
        width = before.shape[1]
        gates = _sigmoid(seen[:, : 2 * width] + known[:, : 2 * width])
        reset, keep = gates[:, :width], gates[:, width:]
        new = np.tanh(seen[:, 2 * width :] + reset * known[:, 2 * width :])
        after: Floats = (1 - keep) * new + keep * before
        return after

    def _token(self, raw: Floats, sampled: RandomDraws | None) -> NDArray[np.int32]:
        if self.channel == "one-hot":
            return _choice(raw, sampled)
        near = 2 * raw @ self.codebook.T - np.square(self.codebook).sum(1)  # |raw|^2 is the same for all K
        token: NDArray[np.int32] = near.argmax(1).astype(np.int32)
        return token

    def _opens(self, state: Floats, sampled: RandomDraws | None) -> NDArray[np.bool_]:
        if self.architecture.gate == "open":
            return np.ones(len(state), np.bool_)
        logit = self._layer("gate", state)[:, 0]
        opens: NDArray[np.bool_] = (
            logit >= 0 if sampled is None else sampled.uniform(len(state)) < _sigmoid(logit)
        )
        return opens


def shapes(of: Architecture) -> dict[str, tuple[int, ...]]:
    """Return every weight of a plain policy and its shape.

    Raises:
        ValueError: the channel has no tokens, or one-hot messages are not as long as the codebook.
    """
    if of.channel not in {"prototype", "one-hot"} or of.tokens < 1:
        raise ValueError("a plain policy has tokens: prototype or one-hot")
    if of.channel == "one-hot" and of.tokens != of.message:
        raise ValueError(f"one-hot messages are as long as the codebook: message {of.message}")
    width, seen = of.hidden, of.observation_size + of.message
    wanted: dict[str, tuple[int, ...]] = {
        "gru.weight_ih": (3 * width, seen), "gru.weight_hh": (3 * width, width),
        "gru.bias_ih": (3 * width,), "gru.bias_hh": (3 * width,),
        "speech.weight": (of.message, width), "speech.bias": (of.message,),
        "think.weight": (width, width + of.message), "think.bias": (width,),
        "act.weight": (of.actions, width), "act.bias": (of.actions,),
    }  # fmt: skip
    if of.channel == "prototype":
        wanted["codebook"] = (of.tokens, of.message)
    if of.gate == "learned":
        wanted |= {"gate.weight": (1, width), "gate.bias": (1,)}
    return wanted


def _sigmoid(x: Floats) -> Floats:
    return np.asarray((1 + np.tanh(x / 2)) / 2, np.float32)  # never overflows


def _choice(logits: Floats, sampled: RandomDraws | None) -> NDArray[np.int32]:
    """Index (R,) of the largest of (R, K), or drawn by softmax."""
    if sampled is None:
        return np.asarray(logits.argmax(1), np.int32)
    weight = np.exp(logits - logits.max(1, keepdims=True)).cumsum(1)
    drawn = sampled.uniform(len(logits))[:, None] * weight[:, -1:]
    index: NDArray[np.int32] = (weight < drawn).sum(1).clip(max=logits.shape[1] - 1).astype(np.int32)
    return index
