"""One line per token as a table for spreadsheets and R: what `hatlab interpret` writes as tokens.csv."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING, Any

import numpy as np

from models.interpret.nulls import information

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from models.interpret.summary import Meaning


def write(meaning: Meaning, path: Path) -> None:
    """Write the table; a token that was never said has empty cells where nothing can be known."""
    lines = list(rows(meaning))
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(lines[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(lines)


def rows(meaning: Meaning) -> Iterator[dict[str, Any]]:
    """Yield one row per token."""
    lexicon, found = meaning.lexicon, meaning.traffic
    info = information(lexicon)
    for token in range(lexicon.tokens):
        row = {
            "token": token,
            "messages": int(lexicon.uses[token]),
            "share": f"{info.share[token]:.6f}",
            "null": int(lexicon.null[token]),
            "entropy_bits": f"{lexicon.entropy_bits[token]:.4f}",
            "told_bits": f"{info.told_bits[token]:.4f}",
            "likeliest_cell": int(lexicon.probability[token].argmax()) if lexicon.uses[token] else "",
            "pc1": f"{lexicon.coordinates[token, 0]:.4f}",
            "pc2": f"{lexicon.coordinates[token, 1]:.4f}",
        }
        if found is not None:
            gas = found.deeds.gas[token]
            row["gas"] = "" if np.isnan(gas) else f"{gas:.4f}"
            lanes = zip(found.lanes.names, found.by_lane[token], strict=True)
            row |= {f"messages_{name.replace(', ', '_').replace(' ', '_')}": int(n) for name, n in lanes}
        yield row
