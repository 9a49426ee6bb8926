"""Messages that say nothing: which tokens are null, and how often they are sent.

Source: Karten et al. on null messages; the rule stands in `models.policies.lexicon`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from models.policies.lexicon import NULL_RATIO, USES_PER_CELL_MIN, divergence_bits, entropy_bits

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.policies.lexicon import Lexicon


THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
"""Shares of H(cell) below which a token might be called null."""


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


class Kinds(NamedTuple):
    """Tokens by what they are good for; the first three are null."""

    never_said: int
    rare: int
    """Said less often than once per cell where anybody spoke (docs/adr/0011)."""
    vague: int
    """Said often enough, and tells less than the threshold."""
    telling: int


def kinds(lexicon: Lexicon) -> Kinds:
    """Count why tokens are null."""
    said, often = lexicon.uses > 0, ~rare(lexicon)
    return Kinds(
        int((~said).sum()),
        int((said & ~often).sum()),
        int((often & lexicon.null).sum()),
        int((~lexicon.null).sum()),
    )


def rare(lexicon: Lexicon) -> NDArray[np.bool_]:
    """Return which tokens (K,) were heard too rarely to know what they mean."""
    limit = max(1.0, USES_PER_CELL_MIN * np.count_nonzero(lexicon.base))
    few: NDArray[np.bool_] = lexicon.uses < limit
    return few


class Sensitivity(NamedTuple):
    """What would be null if the threshold were another."""

    threshold: float
    """Share of H(cell)."""
    tokens: int
    """Null tokens; those said too rarely are null at every threshold."""
    messages: float
    """Share of messages that are null."""


def sensitivity(lexicon: Lexicon) -> tuple[Sensitivity, ...]:
    """Move the threshold below which a token is null."""
    info, few = information(lexicon), rare(lexicon)
    null = {share: few | (info.told_bits < share * info.prior_bits) for share in THRESHOLDS}
    return tuple(Sensitivity(share, int(n.sum()), float(info.share[n].sum())) for share, n in null.items())


def in_use(uses: NDArray[np.int64] | NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which tokens (…, K) are in use: 1 % of the messages, or a tenth of an even share if less.

    Nine tokens need 1 % each; of 100 tokens, each with an even share of 1 %, one counts from 0.1 % on.
    """
    least = min(0.01, 0.1 / max(uses.shape[-1], 1))
    used: NDArray[np.bool_] = uses >= least * np.maximum(uses.sum(axis=-1, keepdims=True), 1)
    return used
