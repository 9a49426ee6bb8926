"""Messages that say nothing: which tokens are null, and how often they are sent.

Source: Karten et al. on null messages; the rule stands in `models.policies.lexicon`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from models.policies.lexicon import NULL_RATIO, divergence_bits, entropy_bits

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.policies.lexicon import Lexicon


@dataclass(frozen=True, eq=False)
class Information:
    """What each token tells about the place of its speaker.

    Attributes:
        share: (K,) share of all messages.
        told_bits: (K,) KL(P(cell | token) ‖ P(cell)).
        needed_bits: below this a token is null.
        prior_bits: H(cell), what a full description of the place would tell.
        null_messages: share of messages whose token is null.
        mutual_bits: mean of told_bits over messages, the information between token and cell.
    """

    share: NDArray[np.float64]
    told_bits: NDArray[np.float64]
    needed_bits: float
    prior_bits: float
    null_messages: float
    mutual_bits: float


def information(lexicon: Lexicon) -> Information:
    """Measure every token of a lexicon."""
    share = lexicon.uses / max(lexicon.samples, 1)
    told = divergence_bits(lexicon.probability, lexicon.base)
    prior = float(entropy_bits(lexicon.base[None])[0])
    return Information(
        share=share,
        told_bits=told,
        needed_bits=NULL_RATIO * prior,
        prior_bits=prior,
        null_messages=float(share[lexicon.null].sum()),
        mutual_bits=float(share @ told),
    )


def in_use(uses: NDArray[np.int64] | NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which tokens (…, K) are in use: 1 % of the messages, or a tenth of an even share if less.

    Nine tokens need 1 % each; of 100 tokens, each with an even share of 1 %, one counts from 0.1 % on.
    """
    least = min(0.01, 0.1 / max(uses.shape[-1], 1))
    used: NDArray[np.bool_] = uses >= least * np.maximum(uses.sum(axis=-1, keepdims=True), 1)
    return used
