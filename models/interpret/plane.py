"""Tokens as points: the principal components of their message vectors, and where they are drawn.

The plane is never turned towards the grid: whether nearness on it means nearness in the world is what the
experiment asks. Positions are made once, here, and stored in the bundle.

Shapes: K tokens, D message.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

PLANE_PX = (430.0, 330.0)
"""Width and height of the panel on which people see the tokens."""
MARGIN_PX = 40.0
"""Free border: a token with the ring that says "chosen" has a radius of 33 px."""
APART_PX = 48.0
"""Least distance of two drawn tokens; nearer ones are moved apart along their line."""
TOKENS_APART_MAX = 24
"""More tokens than this do not fit at that distance and are drawn where they fall; no panel shows so many."""
ROUNDS_MAX = 20_000
ALIKE = 1e-9


class Components(NamedTuple):
    """First two principal components."""

    coordinates: NDArray[np.float64]
    """(K, 2)"""
    explained: NDArray[np.float64]
    """(2,) share of the variance on each axis."""


def principal(vectors: NDArray[np.float64], used: NDArray[np.bool_]) -> Components:
    """Project message vectors (K, D) on their first two principal components.

    The axes come from the tokens in use (a vector nobody sends carries no meaning), and all K are projected.
    The largest loading of each axis is positive, so that the picture does not depend on the solver's sign.

    One-hot vectors are all equally far from each other: every plane explains the same share, and no direction
    is a component. The plane drawn for them is the one in which they stand on a circle, in the order of their
    index. It is as good as any other and means nothing; studies use the positions of their `panel_bundle`.
    """
    kept = vectors[used] if used.sum() > 2 else vectors
    centred = kept - kept.mean(axis=0)
    _, sizes, axes = np.linalg.svd(centred, full_matrices=False)
    share = sizes**2 / max(float((sizes**2).sum()), ALIKE)
    if len(share) > 3 and np.allclose(share[:-1], share[0], rtol=1e-6):
        return _circle(len(vectors), share)
    axes = _pad(axes[:2], vectors.shape[1])
    largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], axis=1)
    axes = axes * np.where(largest < 0, -1.0, 1.0)
    return Components((vectors - kept.mean(axis=0)) @ axes.T, _pad(share[:2, None], 1)[:, 0])


def drawn(coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fit points (K, 2) into the plane and move apart what is too near; result in the unit square, y down.

    One scale for both axes. Pairs nearer than `APART_PX` are moved along their line by what is missing, half
    each, until none is left; no chance is involved.
    """
    low, high = coordinates.min(axis=0), coordinates.max(axis=0)
    room = np.array(PLANE_PX) - 2 * MARGIN_PX
    scale = float(np.min(room / np.maximum(high - low, ALIKE)))
    flipped = (coordinates - (low + high) / 2) * np.array([1.0, -1.0])
    points = flipped * min(scale, 1 / ALIKE) + np.array(PLANE_PX) / 2
    if len(points) <= TOKENS_APART_MAX:
        points = _apart(points)
    unit: NDArray[np.float64] = np.clip(points / np.array(PLANE_PX), 0.0, 1.0)
    return unit


def _apart(points: NDArray[np.float64]) -> NDArray[np.float64]:
    low, high = np.full(2, MARGIN_PX), np.array(PLANE_PX) - MARGIN_PX
    for _ in range(ROUNDS_MAX):
        i, j, gap = _nearest(points)
        if gap >= APART_PX:
            break
        line = (points[j] - points[i]) / gap if gap > ALIKE else _compass(i, j)
        push = line * (APART_PX + 1e-6 - gap) / 2
        points = points.copy()
        points[i], points[j] = points[i] - push, points[j] + push
        points = np.clip(points, low, high)
    return points


def _nearest(points: NDArray[np.float64]) -> tuple[int, int, float]:
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    gaps[np.tril_indices(len(points))] = np.inf
    i, j = np.unravel_index(int(gaps.argmin()), gaps.shape)
    return int(i), int(j), float(gaps[i, j])


def _compass(i: int, j: int) -> NDArray[np.float64]:
    """Give two points at one place a line to part along; the golden angle makes it another for every pair."""
    angle = 2.399963 * (i + 1) * (j + 1)
    return np.array([np.cos(angle), np.sin(angle)])


def _circle(count: int, share: NDArray[np.float64]) -> Components:
    angle = 2 * np.pi * np.arange(count) / count
    return Components(np.stack([np.cos(angle), np.sin(angle)], axis=1), share[:2])


def _pad(rows: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Two rows, the missing ones zero (fewer than two dimensions or tokens)."""
    full = np.zeros((2, width))
    full[: len(rows)] = rows
    return full
