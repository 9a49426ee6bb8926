"""How much of one thing another one tells: mutual information in bits.

Counted frequencies make everything look dependent: with M joint outcomes seen in n samples the plug-in
estimate is about (M - Mx - My + 1) / 2n nats too high. The Miller-Madow correction, which is used here, takes
this off. It supposes independent samples; messages of one episode are not, so that a rest of the bias stays.

Source: Miller 1955, "Note on the bias of information estimates".
"""

from __future__ import annotations

from math import log
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Labels = NDArray[np.int32] | NDArray[np.int64]

SHARED_LEAST = 0.1
"""A token belongs to a group if at least this share of its use is from there."""


class Shared(NamedTuple):
    """What labels x tell about labels y."""

    bits: float
    """Mutual information, corrected, at least 0."""
    plugin_bits: float
    """The same without correction."""
    entropy_bits: float
    """H(y), corrected: what there is to tell."""


class Entropy(NamedTuple):
    """Of one labelling."""

    plugin_bits: float
    outcomes: int
    samples: int

    @property
    def bits(self) -> float:
        """Miller-Madow: plug-in + (outcomes - 1) / 2n nats."""
        return self.plugin_bits + max(self.outcomes - 1, 0) / (2 * max(self.samples, 1) * log(2))


def shared(x: Labels, y: Labels) -> Shared:
    """Measure what x (M,) tells about y (M,)."""
    one, other, both = entropy(x), entropy(y), entropy(pair(x, y))
    bits = one.bits + other.bits - both.bits
    plugin = one.plugin_bits + other.plugin_bits - both.plugin_bits
    return Shared(max(float(bits), 0.0), max(float(plugin), 0.0), float(other.bits))


def entropy(labels: Labels) -> Entropy:
    """Measure the entropy of labels (M,)."""
    counts = np.unique(labels, return_counts=True)[1]
    share = counts / max(len(labels), 1)
    return Entropy(abs(float(-(share * np.log2(share)).sum())), len(counts), len(labels))


def pair(x: Labels, y: Labels) -> NDArray[np.int64]:
    """Return one label (M,) for each pair of labels, none of them below -1."""
    width = int(y.max(initial=0)) + 2
    both: NDArray[np.int64] = (x.astype(np.int64) + 1) * width + (y + 1)
    return both


def groups(tokens: Labels, group: Labels, count: int) -> NDArray[np.int64]:
    """Count in how many groups (count,) each token is at home: `SHARED_LEAST` of its use or more."""
    uses = np.zeros((count, int(group.max(initial=0)) + 1), np.int64)
    np.add.at(uses, (tokens, group), 1)
    home = uses >= SHARED_LEAST * np.maximum(uses.sum(axis=1, keepdims=True), 1)
    homes: NDArray[np.int64] = home.sum(axis=1)
    return homes
