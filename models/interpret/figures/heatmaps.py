"""Where speakers were when they said each token, on the ground of the task."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import altair as alt
import numpy as np

from models.interpret.figures.style import HEAT, INK, Chart, chart, percent, title
from models.interpret.nulls import information

if TYPE_CHECKING:
    from models.interpret.figures.ground import Ground
    from models.policies.lexicon import Lexicon

PER_ROW, SHOWN_MAX = 9, 45
"""Panels in a row, and of one picture: more are neither read nor small."""
PANEL_PX = 108
FLOOR, FAINT = "#e4e8eb", "#bcd3e6"


def heatmaps(lexicon: Lexicon, ground: Ground, shown_max: int = SHOWN_MAX) -> Chart:
    """Draw P(cell | token) of the tokens that mean something, most used first (few: by number)."""
    telling = [
        token for token in np.argsort(-lexicon.uses, kind="stable").tolist() if not lexicon.null[token]
    ]
    shown = telling[:shown_max]
    if lexicon.tokens <= PER_ROW:
        shown = sorted(shown)
    names = {f"{place:03d}": token for place, token in enumerate(shown)}
    if not names:
        return chart([{}]).mark_text(text="no token says where", fontSize=14, color=INK)
    rows, columns = ground.shape
    side = PANEL_PX / max(ground.shape)
    panel = _panel(ground).properties(width=side * columns, height=side * rows)
    faceted = panel.facet(
        facet=alt.Facet("panel:N", header=_header(lexicon, names)),
        columns=5 if len(shown) in {5, 10} else PER_ROW,
        data=alt.Data(values=_floor(ground, names) + _heat(lexicon, ground, names)),  # type: ignore[no-untyped-call]
        spacing=14,
    )
    which = f"{len(shown)} most used of {len(telling)}" if len(telling) > len(shown) else f"{len(shown)}"
    return faceted.properties(
        title=title(
            "Where the speaker was when it said each token",
            f"P(cell | token) of the {which} tokens that say where, light to dark (each to its own largest "
            f"value); above: number, share of the {lexicon.samples:,} messages, entropy",
        )
    )


def _panel(ground: Ground) -> Chart:
    rows, columns = ground.shape
    place = {
        "x": alt.X("x:Q", axis=None, scale=alt.Scale(domain=[0, columns], nice=False)),
        "y": alt.Y("y:Q", axis=None, scale=alt.Scale(domain=[rows, 0], nice=False)),
        "x2": "x2:Q",
        "y2": "y2:Q",
    }
    empty: Chart = alt.Chart()
    floor = (
        empty.transform_filter("datum.p === null")
        .mark_rect(fill=FLOOR, stroke="white", strokeWidth=0.7, fillOpacity=0.85)
        .encode(**place)
    )
    shade = alt.Color("p:Q", scale=alt.Scale(range=[FAINT, HEAT], domain=[0, 1]), legend=None)
    heat = (
        empty.transform_filter("datum.p !== null")
        .mark_rect(stroke="white", strokeWidth=0.5)
        .encode(color=shade, **place)
    )
    return alt.layer(floor, heat)


def _floor(ground: Ground, names: dict[str, int]) -> list[dict[str, Any]]:
    return [
        {"panel": panel, "p": None, "x": x, "y": y, "x2": x2, "y2": y2}
        for panel in names
        for x, y, x2, y2 in ground.strips
    ]


def _heat(lexicon: Lexicon, ground: Ground, names: dict[str, int]) -> list[dict[str, Any]]:
    found = []
    for panel, token in names.items():
        for cell in np.flatnonzero(lexicon.probability[token]).tolist():
            row, column = divmod(cell, ground.shape[1])
            p = round(float(lexicon.probability[token, cell] / lexicon.probability[token].max()), 3)
            found.append({"panel": panel, "p": p, "x": column, "y": row, "x2": column + 1, "y2": row + 1})
    return found


def _header(lexicon: Lexicon, names: dict[str, int]) -> alt.Header:
    share = information(lexicon).share
    labels = {
        panel: [f"{token}", f"{percent(share[token])}, {lexicon.entropy_bits[token]:.1f} bit"]
        for panel, token in names.items()
    }
    return alt.Header(
        title=None,
        labelExpr=_lookup(labels),
        labelFontSize=11,
        labelColor=INK,
        labelAnchor="start",
        labelLineHeight=13,
    )


def _lookup(labels: dict[str, list[str]]) -> str:
    """Vega expression from a panel's key to its label, two lines."""
    pairs = ", ".join(f"'{key}': {lines!r}" for key, lines in labels.items())
    return f"{{{pairs}}}[datum.label]"
