"""Does nearness between prototypes mean nearness in the world? One point per pair of tokens.

A token stands in many pairs, so that pairs are not independent. Intervals come from resampling tokens: a
resample draws as many tokens as there are, with replacement, and holds the pairs of different tokens among
them, each as often as it then occurs.

Where all prototypes are equally far apart (one-hot), there is nothing that could go with distance in the
world: r² is undefined, and reported as 0 by definition, with the reason.

Source: the paper's interpretability figures (prototype distance against distance of mean locations).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.policies.lexicon import Lexicon

RESAMPLES = 1_000
ALIKE = 1e-6
"""Distances of float32 prototypes differ by this much by rounding."""
TOO_FEW = "fewer than 3 pairs of tokens that mean something"
EVEN = "all prototypes are equally far apart: r² is undefined and reported as 0"
ONE_PLACE = "all mean locations are equally far apart: r² is undefined and reported as 0"

Interval = tuple[float, float]


class Line(NamedTuple):
    """Least squares."""

    r2: float
    slope: float
    intercept: float


@dataclass(frozen=True, eq=False)
class Distances:
    """Every pair of tokens that mean something (null tokens have no place to speak of).

    Attributes:
        pairs: (P, 2) token indices, the lower first.
        prototype: (P,) Euclidean distance of their message vectors.
        place: (P,) Euclidean distance of their mean locations, in cells.
        r2: squared Pearson correlation of the two; NaN with fewer than 3 pairs, 0 without spread.
        slope: cells per unit of prototype distance (least squares); NaN where there is no line.
        intercept: cells at prototype distance 0; NaN as above.
        r2_ci95: bootstrap interval over tokens; None where there is no line.
        slope_ci95: as above.
        reason: why there is no line; empty where there is one.
    """

    pairs: NDArray[np.int64]
    prototype: NDArray[np.float64]
    place: NDArray[np.float64]
    r2: float
    slope: float
    intercept: float
    r2_ci95: Interval | None
    slope_ci95: Interval | None
    reason: str


def distances(
    lexicon: Lexicon, vectors: NDArray[np.float64], shape: tuple[int, int], seed: int = 0
) -> Distances:
    """Compare message vectors (K, D) with mean locations on a grid of `shape` (rows, columns)."""
    tokens = np.flatnonzero(~lexicon.null)
    first, second = np.triu_indices(len(tokens), k=1)
    pairs = np.stack([tokens[first], tokens[second]], axis=1)  # (P, 2)
    means = mean_locations(lexicon, shape)
    prototype = np.linalg.norm(vectors[pairs[:, 0]] - vectors[pairs[:, 1]], axis=1)
    place = np.linalg.norm(means[pairs[:, 0]] - means[pairs[:, 1]], axis=1)
    reason = _obstacle(prototype, place)
    if reason:
        nan = float("nan")
        r2 = nan if reason == TOO_FEW else 0.0
        return Distances(pairs, prototype, place, r2, nan, nan, None, None, reason)
    line = _line(prototype, place)
    draws = np.random.default_rng(seed).multinomial(
        len(tokens), np.full(len(tokens), 1 / len(tokens)), RESAMPLES
    )
    r2_ci95, slope_ci95 = _intervals(prototype, place, draws[:, first] * draws[:, second])
    return Distances(pairs, prototype, place, *line, r2_ci95, slope_ci95, "")


def mean_locations(lexicon: Lexicon, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Mean (row, column) of the speaker of each token: (K, 2)."""
    cells = np.arange(lexicon.cells)
    places = np.stack([cells // shape[1], cells % shape[1]], axis=1)  # (C, 2)
    means: NDArray[np.float64] = lexicon.probability @ places
    return means


def _obstacle(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    """Why no line can be drawn through the pairs; empty if one can."""
    if len(x) < 3:
        return TOO_FEW
    if np.ptp(x) < ALIKE:
        return EVEN
    return ONE_PLACE if np.ptp(y) < ALIKE else ""


def _line(x: NDArray[np.float64], y: NDArray[np.float64]) -> Line:
    covariance = np.cov(x, y, bias=True)
    slope = covariance[0, 1] / covariance[0, 0]
    r2 = covariance[0, 1] ** 2 / (covariance[0, 0] * covariance[1, 1])
    return Line(float(r2), float(slope), float(y.mean() - slope * x.mean()))


def _intervals(
    x: NDArray[np.float64], y: NDArray[np.float64], weights: NDArray[np.int64]
) -> tuple[Interval | None, Interval | None]:
    """Percentile intervals of r² and slope from weights (R, P) of the pairs in each resample."""
    total = np.maximum(weights.sum(axis=1), 1)  # (R,)
    mean_x, mean_y = weights @ x / total, weights @ y / total
    var_x = np.maximum(weights @ (x * x) / total - mean_x**2, 0)
    var_y = np.maximum(weights @ (y * y) / total - mean_y**2, 0)
    covariance = weights @ (x * y) / total - mean_x * mean_y
    known = (var_x > ALIKE**2) & (var_y > ALIKE**2)  # a resample may hold no two pairs that differ
    if not known.any():
        return None, None
    slope = covariance[known] / var_x[known]
    return _interval(covariance[known] ** 2 / (var_x[known] * var_y[known])), _interval(slope)


def _interval(values: NDArray[np.float64]) -> Interval:
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)
