"""What tokens mean: for every token, where its speaker was.

A lexicon is a table of frequencies, estimated once from rollouts of a bundle (`models.interpret.estimate`)
and stored beside the weights. This module holds the table, its rules (which token is null) and the one
formula that turns messages into places, `occupancy`. It runs no policy and draws nothing.

Shapes: K tokens, C cells, M messages.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

NULL_RATIO = 0.1
"""A token is null if it tells less than this share of what there is to tell: KL < 0.1·H(cell).

Source: DESIGN section 5.
"""

USES_PER_CELL_MIN = 1.0
"""Small-sample rule: a token heard less often than once per cell where anybody spoke is null.

Counts are not smoothed. With n uses and C such cells the KL of a meaningless token comes out about
(C-1)/(2n) nats too high, so that a rare token would always seem to mean something; from n = C on it is half
a nat at most. The row of such a token is P(cell).
"""


class LexiconError(ValueError):
    """The stored lexicon contradicts itself; the message names the field."""


@dataclass(frozen=True, eq=False)
class Lexicon:
    """P(cell | token) of one bundle, and where its tokens are drawn.

    Attributes:
        tokens: K, the size of the codebook.
        cells: C, the number of cells of the world.
        probability: (K, C) P(cell of the speaker | token); every row sums to 1.
        uses: (K,) messages counted for each token.
        entropy_bits: (K,) entropy of each row, in bits.
        null: (K,) True where the token says (nearly) nothing about the place of its speaker.
        positions: (K, 2) where tokens are drawn, x to the right and y down, in the unit square.
        explained: (2,) share of the prototypes' variance on each drawn axis.
        samples: number of messages counted.
        seed: seed of the episodes that were counted.
        coordinates: (K, 2) principal components before drawing; empty if not kept.
    """

    tokens: int
    cells: int
    probability: NDArray[np.float64]
    uses: NDArray[np.int64]
    entropy_bits: NDArray[np.float64]
    null: NDArray[np.bool_]
    positions: NDArray[np.float64]
    explained: NDArray[np.float64]
    samples: int
    seed: int
    coordinates: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))

    @classmethod
    def from_counts(  # the rules of the table stand in one place
        cls,
        counts: ArrayLike,
        positions: ArrayLike,
        explained: ArrayLike = (1.0, 0.0),
        *,
        seed: int = 0,
        coordinates: ArrayLike | None = None,
    ) -> Lexicon:
        """Make the table from (K, C) counts of messages by token and cell of the speaker."""
        table = np.asarray(counts, dtype=np.int64)  # (K, C)
        uses = table.sum(axis=1)  # (K,)
        base = base_rate(table)  # (C,)
        rare = uses < max(1.0, USES_PER_CELL_MIN * np.count_nonzero(table.sum(axis=0)))
        probability = np.where(rare[:, None], base, table / np.maximum(uses, 1)[:, None])
        told = divergence_bits(probability, base)  # (K,)
        return cls(
            tokens=table.shape[0],
            cells=table.shape[1],
            probability=probability,
            uses=uses,
            entropy_bits=entropy_bits(probability),
            null=rare | (told < NULL_RATIO * entropy_bits(base[None])[0]),
            positions=np.asarray(positions, dtype=np.float64),
            explained=np.asarray(explained, dtype=np.float64),
            samples=int(uses.sum()),
            seed=seed,
            coordinates=np.zeros((0, 2))
            if coordinates is None
            else np.asarray(coordinates, dtype=np.float64),
        )

    @property
    def base(self) -> NDArray[np.float64]:
        """P(cell), (C,): the mean row, weighted by use."""
        if self.samples == 0:
            return np.full(self.cells, 1 / self.cells)
        mixed: NDArray[np.float64] = self.uses @ self.probability / self.samples
        return mixed

    def to_json(self) -> dict[str, Any]:
        """Return the table as plain lists; `from_json` gives back the same numbers, bit by bit."""
        return {
            "tokens": self.tokens,
            "cells": self.cells,
            "samples": self.samples,
            "seed": self.seed,
            "uses": self.uses.tolist(),
            "entropy_bits": self.entropy_bits.tolist(),
            "null": self.null.tolist(),
            "explained": self.explained.tolist(),
            "positions": self.positions.tolist(),
            "coordinates": self.coordinates.tolist(),
            "probability": self.probability.tolist(),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Lexicon:
        """Read what `to_json` wrote.

        Raises:
            LexiconError: a field is missing, has another shape, or holds what cannot be.
        """
        tokens, cells = _count(data, "tokens"), _count(data, "cells")
        lexicon = cls(
            tokens=tokens,
            cells=cells,
            probability=_array(data, "probability", (tokens, cells)),
            uses=_array(data, "uses", (tokens,)).astype(np.int64),
            entropy_bits=_array(data, "entropy_bits", (tokens,)),
            null=_array(data, "null", (tokens,)).astype(np.bool_),
            positions=_array(data, "positions", (tokens, 2)),
            explained=_array(data, "explained", (2,)),
            samples=_count(data, "samples"),
            seed=_count(data, "seed"),
            coordinates=_array(data, "coordinates", (len(data.get("coordinates", ())), 2)),
        )
        _check(lexicon)
        return lexicon


def occupancy(lexicon: Lexicon, tokens: NDArray[np.int32], gates: NDArray[np.bool_]) -> NDArray[np.float64]:
    """How likely it is that a car that just spoke stands on each cell.

    1 - Π(1 - P(cell | token)) over the messages heard; null tokens, closed gates and silence add nothing.

    Args:
        lexicon: what the tokens mean.
        tokens: (M,) messages of one step, SILENT (-1) where a seat says nothing.
        gates: (M,) whether each was sent.

    Returns:
        (C,) likelihoods in [0, 1].
    """
    said = np.asarray(tokens)[np.asarray(gates, dtype=np.bool_) & (np.asarray(tokens) >= 0)]
    told = said[~lexicon.null[said]]  # (M',)
    likelihood: NDArray[np.float64] = 1.0 - np.prod(1.0 - lexicon.probability[told], axis=0)  # (C,)
    return likelihood


def base_rate(counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """P(cell) from (K, C) counts: (C,); uniform if nothing was said."""
    total = counts.sum()
    cells = counts.shape[1]
    return counts.sum(axis=0) / total if total else np.full(cells, 1 / cells)


def entropy_bits(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Entropy of each row of (K, C) probabilities, in bits: (K,)."""
    logs = np.log2(rows, out=np.zeros_like(rows), where=rows > 0)
    bits: NDArray[np.float64] = np.abs((rows * logs).sum(axis=1))  # no -0.0
    return bits


def divergence_bits(rows: NDArray[np.float64], base: NDArray[np.float64]) -> NDArray[np.float64]:
    """KL(row ‖ base) of each row of (K, C), in bits: (K,). A row must be 0 wherever the base is."""
    ratio = np.divide(rows, base, out=np.ones_like(rows), where=rows > 0)
    bits: NDArray[np.float64] = (rows * np.log2(ratio)).sum(axis=1)
    return bits


def _count(data: Mapping[str, Any], key: str) -> int:
    value = data.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise LexiconError(f"{key} must be a whole number of 0 or more, not {value!r}")
    return value


def _array(data: Mapping[str, Any], key: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    try:
        values = np.array(data[key], dtype=np.float64)
    except KeyError:
        raise LexiconError(f"{key} is missing") from None
    except (TypeError, ValueError):
        raise LexiconError(f"{key} is not an array of numbers of shape {shape}") from None
    values = values.reshape(shape) if values.size == 0 and 0 in shape else values
    if values.shape != shape:
        raise LexiconError(f"{key} has shape {values.shape}, expected {shape}")
    if not np.isfinite(values).all():
        raise LexiconError(f"{key} holds a number that is not finite")
    return values


def _check(lexicon: Lexicon) -> None:
    rows = lexicon.probability
    if (rows < 0).any() or not np.allclose(rows.sum(axis=1), 1.0, rtol=0, atol=1e-9):
        raise LexiconError("probability has a row that does not sum to 1")
    if (lexicon.positions < 0).any() or (lexicon.positions > 1).any():
        raise LexiconError("positions leave the unit square")
    if (lexicon.uses < 0).any() or int(lexicon.uses.sum()) != lexicon.samples:
        raise LexiconError("uses do not sum to samples")
    if not np.allclose(lexicon.entropy_bits, entropy_bits(rows), rtol=0, atol=1e-6):
        raise LexiconError("entropy_bits do not belong to probability")
