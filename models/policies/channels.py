"""What a message may be, and whether it is sent: the channels and the gate, as torch modules.

A channel turns the speaker's raw vector into the message that listeners receive. Discrete channels pass the
gradient straight through: the value is the codebook's, the slope is the raw vector's.

Source: the paper, section 3 (prototypes); van den Oord et al. 2017, "Neural Discrete Representation Learning"
(nearest neighbour, commitment); Bengio et al. 2013 (straight-through).
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn

COMMITMENT = (
    0.25  # weight of the pull on the speaker towards its prototype (van den Oord et al., section 3.2)
)
CHANNELS = ("none", "continuous", "prototype", "one-hot")


class Utterance(NamedTuple):
    """R raw vectors after the channel: token (R,) int64 (-1: none), message (R, D), upkeep loss (R,)."""

    token: Tensor
    message: Tensor
    loss: Tensor


class ContinuousChannel(nn.Module):
    """Any vector may be sent."""

    def forward(self, raw: Tensor) -> Utterance:
        token = torch.full((raw.shape[0],), -1, dtype=torch.int64, device=raw.device)
        return Utterance(token, raw, raw.new_zeros(len(raw)))


class NoChannel(nn.Module):
    """Nothing can be said: messages are zeros."""

    def forward(self, raw: Tensor) -> Utterance:
        token = torch.full((raw.shape[0],), -1, dtype=torch.int64, device=raw.device)
        return Utterance(token, torch.zeros_like(raw), raw.new_zeros(len(raw)))


class PrototypeChannel(nn.Module):
    """One of K learned vectors, the nearest to the raw one (ties: lowest index)."""

    def __init__(self, tokens: int, size: int) -> None:
        super().__init__()
        self.codebook = nn.Parameter(torch.randn(tokens, size) * 0.5)  # (K, D)

    def nearest(self, raw: Tensor) -> Tensor:
        """Index (R,) of the nearest prototype of raw vectors (R, D)."""
        squares = self.codebook.square().sum(1) - 2 * raw @ self.codebook.T  # |raw|^2 is the same for all K
        return squares.argmin(1)

    def forward(self, raw: Tensor) -> Utterance:
        token = self.nearest(raw.detach())
        prototype = nn.functional.embedding(token, self.codebook)  # (R, D)
        pull = (prototype - raw.detach()).square().sum(1)
        commit = (raw - prototype.detach()).square().sum(1)
        return Utterance(token, straight_through(prototype.detach(), raw), pull + COMMITMENT * commit)


class OneHotChannel(nn.Module):
    """One of K names without geometry: the raw vector holds logits."""

    def forward(self, raw: Tensor, draws: Tensor | None = None) -> Utterance:
        """Greedy, or sampled by inverse transform where uniform ``draws`` (R,) are given."""
        soft = raw.softmax(1)  # (R, K)
        token = raw.argmax(1) if draws is None else pick(soft.detach(), draws)
        hard = nn.functional.one_hot(token, raw.shape[1]).to(raw.dtype)
        return Utterance(token, straight_through(hard, soft), raw.new_zeros(len(raw)))


Channel = NoChannel | ContinuousChannel | PrototypeChannel | OneHotChannel


def make_channel(kind: str, tokens: int, size: int) -> Channel:
    """The channel named ``kind``.

    Raises:
        ValueError: the name is unknown, or the sizes do not fit it.
    """
    if kind == "prototype" and tokens < 1:
        raise ValueError("a prototype channel needs at least one token")
    if kind == "one-hot" and tokens != size:
        raise ValueError(f"one-hot messages are as long as the codebook: message {size}, tokens {tokens}")
    match kind:
        case "none":
            return NoChannel()
        case "continuous":
            return ContinuousChannel()
        case "prototype":
            return PrototypeChannel(tokens, size)
        case "one-hot":
            return OneHotChannel()
        case _:
            raise ValueError(f"unknown channel {kind!r}; choose one of {', '.join(CHANNELS)}")


def straight_through(value: Tensor, slope: Tensor) -> Tensor:
    """The value of the first, the gradient of the second."""
    return slope + (value - slope).detach()


def pick(probability: Tensor, draws: Tensor) -> Tensor:
    """Index (R,) drawn from rows of probabilities (R, K) by uniform numbers (R,)."""
    index = (probability.cumsum(1) < draws.unsqueeze(1)).sum(1)
    return index.clamp(max=probability.shape[1] - 1)


def gate_of(logit: Tensor, draws: Tensor | None) -> Tensor:
    """Gate (R,) as 0.0 or 1.0: open where the logit is not negative, or sampled where draws are given.

    The gradient is that of the probability (straight-through), so that listeners teach speakers when to
    speak.
    """
    probability = torch.sigmoid(logit)
    hard = (logit >= 0) if draws is None else (draws < probability)
    return straight_through(hard.to(logit.dtype), probability)
