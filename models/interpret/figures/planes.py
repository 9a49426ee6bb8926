"""Tokens as points on their first two principal components: by null flag, lane, what their speakers do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import altair as alt
import numpy as np

from models.interpret.figures.style import (
    FEW,
    INK,
    SERIES,
    SHAPES,
    Chart,
    axis,
    chart,
    kinds,
    percent,
    title,
)
from models.interpret.nulls import information

if TYPE_CHECKING:
    from collections.abc import Callable

    from models.interpret.deeds import Deeds
    from models.interpret.traffic import Traffic
    from models.policies.lexicon import Lexicon

SIDE = 380
APART_PX = (17, 10)
"""Room of the name of one of many tokens; a name without room is left out, the most used tokens first."""
DRIVES = {"all gas (≥ 95 %)": 0.95, "mostly gas": 0.5, "mostly brake": -1.0}
"""Kinds of tokens by least P(gas | token)."""


def prototypes(lexicon: Lexicon) -> Chart:
    """Draw the tokens on their first two principal components, equal units on both axes."""
    few = lexicon.tokens <= FEW
    rows = _rows(lexicon, lambda token: "null" if lexicon.null[token] else "says where")
    base = chart(rows).encode(**_axes(lexicon))
    dots = base.mark_circle(opacity=0.9 if few else 0.35, stroke="white", strokeWidth=1).encode(
        color=kinds(), size=alt.value(620) if few else _sizes()
    )
    names = _names(rows, lexicon)
    if few:
        names = names.mark_text(fontSize=14, fontWeight=600).encode(
            color=alt.condition(alt.datum.kind == "null", alt.value(INK), alt.value("white"))
        )
    null = sum(row["null"] for row in rows)
    subtitle = f"{len(rows) - null} tokens that say where" + (f"; {null} null ones in grey" if null else "")
    return (dots + names).properties(width=SIDE, height=SIDE, title=title("Prototypes", subtitle))


def by_lane(lexicon: Lexicon, traffic: Traffic) -> Chart:
    """Draw the tokens by the direction of the lane that most of their messages come from."""
    names = [name.split(",")[0] for name in traffic.lanes.names]
    headings = sorted(set(names))
    rows = _rows(lexicon, lambda token: names[int(traffic.by_lane[token].argmax())])
    common = traffic.common_lanes
    subtitle = (
        f"{traffic.lane.bits:.2f} of {traffic.lane.entropy_bits:.2f} bits about the lane; "
        f"{common.tokens} of {common.of} tokens shared by lanes"
    )
    return _kinds_plane(lexicon, rows, headings, title("On which lane is the speaker?", subtitle))


def by_gas(lexicon: Lexicon, deeds: Deeds) -> Chart:
    """Draw the tokens by what their speakers do."""

    def kind(token: int) -> str:
        return next((name for name, least in DRIVES.items() if deeds.gas[token] >= least), "never said")

    subtitle = f"{deeds.token.bits:.2f} of {deeds.token.entropy_bits:.2f} bits about gas or brake"
    return _kinds_plane(lexicon, _rows(lexicon, kind), list(DRIVES), title("What does it do?", subtitle))


def _kinds_plane(
    lexicon: Lexicon, rows: list[dict[str, Any]], domain: list[str], heading: alt.TitleParams
) -> Chart:
    """Tokens that mean something, each kind with its colour and shape."""
    kept = [row for row in rows if not row["null"]]
    legend = alt.Legend(title=None, orient="bottom", labelFontSize=12, symbolSize=110)
    base = chart(kept).encode(**_axes(lexicon))
    points = base.mark_point(filled=True, opacity=0.8, stroke="white", strokeWidth=0.8).encode(
        color=alt.Color(
            "kind:N", scale=alt.Scale(domain=domain, range=list(SERIES[: len(domain)])), legend=legend
        ),
        shape=alt.Shape(
            "kind:N", scale=alt.Scale(domain=domain, range=list(SHAPES[: len(domain)])), legend=legend
        ),
        size=_sizes(260),
    )
    return points.properties(width=SIDE, height=SIDE, title=heading)


def _rows(lexicon: Lexicon, kind: Callable[[int], str]) -> list[dict[str, Any]]:
    """One row per token that is drawn, most used first."""
    info = information(lexicon)
    return [
        {
            "token": str(token),
            "x": float(lexicon.coordinates[token, 0]),
            "y": float(lexicon.coordinates[token, 1]),
            "share": float(info.share[token]),
            "kind": kind(token),
            "null": bool(lexicon.null[token]),
        }
        for token in np.argsort(-lexicon.uses, kind="stable").tolist()
        if lexicon.tokens <= FEW or lexicon.uses[token] > 0
    ]


def _names(rows: list[dict[str, Any]], lexicon: Lexicon) -> Chart:
    """Numbers of the tokens: all of few; of many those that have room."""
    if lexicon.tokens > FEW:
        rows = _with_room([row for row in rows if not row["null"]], lexicon)
    return chart(rows).mark_text(fontSize=9, color=INK).encode(x="x:Q", y="y:Q", text="token:N")


def _with_room(rows: list[dict[str, Any]], lexicon: Lexicon) -> list[dict[str, Any]]:
    (low, high), _ = _square(lexicon)
    px = SIDE / (high - low)
    kept: list[dict[str, Any]] = []
    for row in rows:
        if all(
            abs(row["x"] - other["x"]) * px >= APART_PX[0] or abs(row["y"] - other["y"]) * px >= APART_PX[1]
            for other in kept
        ):
            kept.append(row)
    return kept


def _axes(lexicon: Lexicon) -> dict[str, Any]:
    domain_x, domain_y = _square(lexicon)
    share = [percent(part) for part in lexicon.explained]
    return {
        "x": axis("x", f"first component ({share[0]} of variance)", domain_x),
        "y": axis("y", f"second component ({share[1]} of variance)", domain_y),
    }


def _sizes(most: int = 500) -> alt.Size:
    return alt.Size("share:Q", scale=alt.Scale(range=[30, most]), legend=None)


def _square(lexicon: Lexicon) -> tuple[tuple[float, float], tuple[float, float]]:
    """Domains of x and y with equal units and a margin."""
    low, high = lexicon.coordinates.min(axis=0), lexicon.coordinates.max(axis=0)
    middle, half = (low + high) / 2, max(float((high - low).max()) / 2 * 1.12, 1e-6)
    x, y = ((float(m - half), float(m + half)) for m in middle)
    return x, y
