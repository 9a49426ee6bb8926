"""From continuous messages to a codebook: k-means, and new life for prototypes that nobody uses."""

import torch
from torch import Tensor

ROUNDS = 30  # of Lloyd's algorithm; assignments of 112 prototypes settle in 10-20


def kmeans(vectors: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Centres (K, D) of vectors (M, D): k-means++ seeding, then Lloyd's algorithm.

    Source: Arthur and Vassilvitskii 2007.
    """
    centres = _spread(vectors, count, generator)
    for _ in range(ROUNDS):
        nearest = torch.cdist(vectors, centres).argmin(1)
        size = torch.bincount(nearest, minlength=count)
        total = torch.zeros_like(centres).index_add(0, nearest, vectors)
        centres = torch.where(size.unsqueeze(1) > 0, total / size.clamp(min=1).unsqueeze(1), centres)
    return centres


def _spread(vectors: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Starting centres: each drawn in proportion to the squared distance from those before."""
    first = int(torch.randint(len(vectors), (1,), generator=generator))
    centres = vectors[first : first + 1]
    distance = (vectors - centres).square().sum(1)
    for _ in range(count - 1):
        weight = distance + 1e-12  # all equal vectors: any will do
        chosen = int(torch.multinomial(weight, 1, generator=generator))
        centres = torch.cat((centres, vectors[chosen : chosen + 1]))
        distance = torch.minimum(distance, (vectors - vectors[chosen]).square().sum(1))
    return centres


def head_start(uses: Tensor) -> Tensor:
    """What to add to the logits of one-hot names (K,): rare names gain, frequent ones lose, at most 1 nat.

    A name that gains takes over where it was nearly chosen before, so that its places stay together.
    """
    share = (uses + 1) / (uses.sum() + len(uses))
    return (-(share * len(uses)).log()).clamp(-1.0, 1.0)


def revived(codebook: Tensor, uses: Tensor, vectors: Tensor, generator: torch.Generator) -> Tensor:
    """The codebook (K, D) with unused prototypes (uses (K,)) moved to vectors (M, D) far from theirs."""
    dead = torch.nonzero(uses == 0).squeeze(1)
    if not len(dead) or not len(vectors):
        return codebook
    distance = (
        torch.cdist(vectors, codebook[uses > 0] if len(dead) < len(codebook) else codebook).min(1).values
    )
    chosen = torch.multinomial(distance.square() + 1e-12, len(dead), replacement=True, generator=generator)
    fresh = codebook.clone()
    fresh[dead] = vectors[chosen]
    return fresh
