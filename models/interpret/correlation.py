"""Does nearness between prototypes mean nearness in the world? One point per pair of tokens.

Source: the paper's interpretability figures (prototype distance against distance of mean locations).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.policies.lexicon import Lexicon


@dataclass(frozen=True, eq=False)
class Distances:
    """Every pair of tokens that mean something (null tokens have no place to speak of).

    Attributes:
        pairs: (P, 2) token indices, the lower first.
        prototype: (P,) Euclidean distance of their message vectors.
        place: (P,) Euclidean distance of their mean locations, in cells.
        r2: squared Pearson correlation of the two; NaN with fewer than 3 pairs or without spread.
        slope: cells per unit of prototype distance (least squares).
        intercept: cells at prototype distance 0.
    """

    pairs: NDArray[np.int64]
    prototype: NDArray[np.float64]
    place: NDArray[np.float64]
    r2: float
    slope: float
    intercept: float


def distances(lexicon: Lexicon, vectors: NDArray[np.float64], shape: tuple[int, int]) -> Distances:
    """Compare message vectors (K, D) with mean locations on a grid of `shape` (rows, columns)."""
    tokens = np.flatnonzero(~lexicon.null)
    first, second = np.triu_indices(len(tokens), k=1)
    pairs = np.stack([tokens[first], tokens[second]], axis=1)  # (P, 2)
    means = mean_locations(lexicon, shape)
    prototype = np.linalg.norm(vectors[pairs[:, 0]] - vectors[pairs[:, 1]], axis=1)
    place = np.linalg.norm(means[pairs[:, 0]] - means[pairs[:, 1]], axis=1)
    return Distances(pairs, prototype, place, *_line(prototype, place))


def mean_locations(lexicon: Lexicon, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Mean (row, column) of the speaker of each token: (K, 2)."""
    cells = np.arange(lexicon.cells)
    places = np.stack([cells // shape[1], cells % shape[1]], axis=1)  # (C, 2)
    means: NDArray[np.float64] = lexicon.probability @ places
    return means


def _line(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float, float]:
    """Least squares: r², slope, intercept."""
    if len(x) < 3 or np.ptp(x) < 1e-9 or np.ptp(y) < 1e-9:
        return float("nan"), float("nan"), float("nan")
    covariance = np.cov(x, y, bias=True)
    slope = covariance[0, 1] / covariance[0, 0]
    r2 = covariance[0, 1] ** 2 / (covariance[0, 0] * covariance[1, 1])
    return float(r2), float(slope), float(y.mean() - slope * x.mean())
