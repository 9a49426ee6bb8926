"""When agents speak on their way: the message rate by place on the route, and of cars that just appeared.

Trials are resampled whole for intervals, because the turns of one trial are not independent.

Shapes: P positions, R resamples, B episodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.interpret.turns import Turns

RESAMPLES = 1_000


class Rate(NamedTuple):
    """Messages sent per turn."""

    mean: float
    ci95: tuple[float, float]
    turns: int


@dataclass(frozen=True)
class Along:
    """Message rates.

    Attributes:
        overall: in all turns.
        entering: in the step in which a car appears.
        positions: by cells driven since the entrance, from 0 on; positions without turns are left out.
    """

    overall: Rate
    entering: Rate | None
    positions: dict[int, Rate]


def along(turns: Turns, seed: int) -> Along:
    """Measure the message rate along the route."""
    where = {int(place): turns.position == place for place in np.unique(turns.position)}
    kinds = [np.ones(len(turns.sent), np.bool_), turns.entered, *where.values()]
    overall, entering, *positions = _rates(turns, kinds, seed)
    return Along(
        overall,
        entering if entering.turns else None,
        dict(zip(where, positions, strict=True)),
    )


def _rates(turns: Turns, kinds: list[NDArray[np.bool_]], seed: int) -> list[Rate]:
    """Rates over several kinds of turns, from the same resamples of episodes."""
    count = int(turns.episode.max(initial=0)) + 1
    possible = np.stack([_per_episode(turns, kind, count) for kind in kinds], axis=1)  # (B, P)
    sent = np.stack([_per_episode(turns, kind & turns.sent, count) for kind in kinds], axis=1)
    draws = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), RESAMPLES)  # (R, B)
    resampled = (draws @ sent) / np.maximum(draws @ possible, 1)
    low, high = np.quantile(resampled, [0.025, 0.975], axis=0)
    means = sent.sum(axis=0) / np.maximum(possible.sum(axis=0), 1)
    return [
        Rate(float(mean), (float(a), float(b)), int(n))
        for mean, a, b, n in zip(means, low, high, possible.sum(axis=0), strict=True)
    ]


def _per_episode(turns: Turns, kind: NDArray[np.bool_], count: int) -> NDArray[np.float64]:
    return np.bincount(turns.episode[kind], minlength=count).astype(np.float64)
