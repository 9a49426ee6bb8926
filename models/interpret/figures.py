"""The pictures of a lexicon, each one chart definition that is written as SVG (or PNG, to look at).

One hue for amounts, one accent for what is meant, grey for what is null or for reference; units in axis
titles, the finding in the subtitle, no legend where a label does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import altair as alt
import numpy as np
import vl_convert

from models.interpret.nulls import information

if TYPE_CHECKING:
    from pathlib import Path

    from models.interpret.calibration import Calibration
    from models.interpret.correlation import Distances
    from models.policies.lexicon import Lexicon


Chart = Any
"""An altair chart of any kind; its classes share their methods through untyped mix-ins."""

INK, SOFT, LINE, ACCENT, ORANGE, HEAT_0, HEAT, NULL = (
    "#14181c",
    "#5f6973",
    "#dfe3e6",
    "#0b5a8f",
    "#c94c18",
    "#f1f4f6",
    "#12477a",
    "#c6ccd1",
)
FONT = "Helvetica, Arial, 'DejaVu Sans', sans-serif"
HEATMAPS_PER_ROW = 9
FEW = 24
"""Up to this many tokens each is named and drawn large."""
TALL = 300
"""Height of a plot in px."""


def figures(
    lexicon: Lexicon,
    found: Distances,
    shape: tuple[int, int],
    calibration: dict[str, Calibration] | None = None,
) -> dict[str, Chart]:
    """Return every figure of a lexicon by its file name (without suffix)."""
    charts: dict[str, Chart] = {
        "prototypes": prototypes(lexicon),
        "heatmaps": heatmaps(lexicon, shape),
        "distances": distance_scatter(found),
        "token-use": token_use(lexicon),
        "null-tokens": null_tokens(lexicon),
    }
    if calibration is not None:
        charts["calibration"] = calibration_plot(calibration)
    return charts


def write(charts: dict[str, Chart], out: Path, *, png: bool = False) -> list[Path]:
    """Write each chart as SVG, and as PNG if asked; return the files."""
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for name, chart in charts.items():
        spec = _styled(chart).to_dict()
        path = out / f"{name}.svg"
        path.write_text(vl_convert.vegalite_to_svg(spec) + "\n", encoding="utf-8")
        written.append(path)
        if png:
            path = out / f"{name}.png"
            path.write_bytes(vl_convert.vegalite_to_png(spec, scale=2))
            written.append(path)
    return written


def prototypes(lexicon: Lexicon) -> Chart:
    """Draw the tokens on their first two principal components, equal units on both axes."""
    info = information(lexicon)
    rows = [
        {
            "token": str(token),
            "x": float(x),
            "y": float(y),
            "share": float(info.share[token]),
            "kind": "null" if lexicon.null[token] else "says where",
        }
        for token, (x, y) in enumerate(lexicon.coordinates)
        if lexicon.tokens <= FEW or lexicon.uses[token] > 0
    ]
    side = 380
    domain_x, domain_y = _square(lexicon)
    few = lexicon.tokens <= FEW
    base = _chart(rows).encode(
        x=_axis("x", f"first component ({_percent(lexicon.explained[0])} of variance)", domain_x),
        y=_axis("y", f"second component ({_percent(lexicon.explained[1])} of variance)", domain_y),
    )
    dots = base.mark_circle(opacity=0.9 if few else 0.35, stroke="white", strokeWidth=1).encode(
        color=_kinds(),
        size=alt.value(620) if few else alt.Size("share:Q", scale=alt.Scale(range=[30, 500]), legend=None),
    )
    names = base.mark_text(fontSize=14 if few else 9, fontWeight=600 if few else 400).encode(
        text="token:N",
        color=alt.condition(alt.datum.kind == "null", alt.value(INK), alt.value("white"))
        if few
        else alt.value(INK),
    )
    title = _title("Prototypes", f"{len(rows)} tokens on their first two principal components")
    return (dots + names).properties(width=side, height=side, title=title)


def heatmaps(lexicon: Lexicon, shape: tuple[int, int]) -> Chart:
    """Draw P(cell | token) of every token in use on the grid, most used first."""
    info = information(lexicon)
    shown = [int(token) for token in np.argsort(-lexicon.uses, kind="stable") if lexicon.uses[token] > 0]
    if lexicon.tokens <= HEATMAPS_PER_ROW:
        shown = sorted(shown)
    rows = [
        {
            "panel": f"{place:03d}",
            "row": cell // shape[1],
            "column": cell % shape[1],
            "p": float(lexicon.probability[token, cell] / lexicon.probability[token].max()),
        }
        for place, token in enumerate(shown)
        for cell in np.flatnonzero(lexicon.base).tolist()  # where nobody ever spoke stays white
    ]
    labels = {f"{place:03d}": _label(lexicon, info.share, token) for place, token in enumerate(shown)}
    cell_px = 108 / max(shape)
    chart = (
        _chart(rows)
        .mark_rect(stroke="white", strokeWidth=0.4)
        .encode(
            x=alt.X("column:O", axis=None),
            y=alt.Y("row:O", axis=None),
            color=alt.Color("p:Q", scale=alt.Scale(range=[HEAT_0, HEAT], domain=[0, 1]), legend=None),
            facet=alt.Facet(
                "panel:N",
                columns=min(HEATMAPS_PER_ROW, 5 if len(shown) in {5, 10} else HEATMAPS_PER_ROW),
                header=alt.Header(
                    title=None,
                    labelExpr=_lookup(labels),
                    labelFontSize=11,
                    labelColor=INK,
                    labelAnchor="start",
                    labelLineHeight=13,
                ),
            ),
        )
        .properties(width=cell_px * shape[1], height=cell_px * shape[0])
    )
    return chart.properties(
        title=_title(
            "Where the speaker was when it said each token",
            f"P(cell | token), each panel from 0 (light) to its own largest value (dark); share of the "
            f"{lexicon.samples:,} messages and entropy above; null tokens draw nothing",
        )
    )


def distance_scatter(found: Distances) -> Chart:
    """Draw distance of prototypes against distance of mean locations, one point per pair of tokens."""
    rows = [{"x": float(x), "y": float(y)} for x, y in zip(found.prototype, found.place, strict=True)]
    many = len(rows) > 200
    points = (
        _chart(rows)
        .mark_circle(size=18 if many else 48, opacity=0.25 if many else 0.65, color=ACCENT)
        .encode(
            x=_axis("x", "distance between prototypes (units of the message space)"),
            y=_axis(
                "y", "distance between mean locations (cells)", (0, 1.08 * float(found.place.max(initial=1)))
            ),
        )
    )
    if np.isnan(found.r2):
        subtitle = "too few tokens that differ: no line"
        layers = points
    else:
        high = float(found.prototype.max())
        ends = [
            {"x": x, "y": found.intercept + found.slope * x} for x in (float(found.prototype.min()), high)
        ]
        line = _chart(ends).mark_line(color=ORANGE, strokeWidth=2, clip=True).encode(x="x:Q", y="y:Q")
        layers = points + line
        subtitle = (
            f"r² = {found.r2:.2f}, slope {found.slope:.2f} cells per unit, {len(rows):,} pairs of tokens"
        )
    return layers.properties(
        width=420, height=TALL, title=_title("Does near in meaning mean near in the world?", subtitle)
    )


def token_use(lexicon: Lexicon) -> Chart:
    """Draw how often each token was said, by index if they are few, else most used first."""
    info = information(lexicon)
    order = range(lexicon.tokens) if lexicon.tokens <= FEW else np.argsort(-lexicon.uses, kind="stable")
    rows = [
        {
            "place": place,
            "token": str(int(token)),
            "share": float(info.share[token]),
            "kind": "null" if lexicon.null[token] else "says where",
        }
        for place, token in enumerate(order)
        if lexicon.tokens <= FEW or lexicon.uses[token] > 0
    ]
    bars = (
        _chart(rows)
        .mark_bar()
        .encode(
            x=alt.X(
                "token:N",
                sort=[str(row["token"]) for row in rows],
                title="token",
                axis=alt.Axis(
                    labelAngle=0, labelOverlap=False, labelFontSize=12 if lexicon.tokens <= FEW else 9
                ),
            ),
            y=alt.Y("share:Q", title="share of messages", axis=alt.Axis(format="%")),
            color=_kinds(),
        )
    )
    even = _chart([{"even": 1 / lexicon.tokens}]).mark_rule(color=SOFT, strokeDash=[4, 4]).encode(y="even:Q")
    used = int((lexicon.uses > 0).sum())
    subtitle = (
        f"{used} of {lexicon.tokens} tokens said in {lexicon.samples:,} messages; "
        f"dashed: an even share; null tokens carry {_percent(info.null_messages)}"
    )
    return (bars + even).properties(
        width=max(420, 19 * len(rows)), height=220, title=_title("Token use", subtitle)
    )


def null_tokens(lexicon: Lexicon) -> Chart:
    """Draw what each token tells about its speaker's place, against the limit below which it is null."""
    info = information(lexicon)
    rows = [
        {
            "share": float(info.share[token]),
            "told": float(info.told_bits[token]),
            "token": str(token),
            "kind": "null" if lexicon.null[token] else "says where",
        }
        for token in range(lexicon.tokens)
        if lexicon.uses[token] > 0
    ]
    base = _chart(rows).encode(
        x=alt.X("share:Q", title="share of messages", axis=alt.Axis(format="%"), scale=alt.Scale(zero=True)),
        y=alt.Y(
            "told:Q",
            title="information about the cell (bits)",
            scale=alt.Scale(domain=[0, 1.08 * max(info.prior_bits, float(info.told_bits.max()), 0.1)]),
        ),
    )
    dots = base.mark_circle(size=90, opacity=0.85).encode(color=_kinds())
    few = [row for row in rows if lexicon.tokens <= FEW]
    names = (
        _chart(few)
        .mark_text(dx=9, align="left", fontSize=11, color=INK)
        .encode(x="share:Q", y="told:Q", text="token:N")
    )
    limits = [
        {"bits": info.needed_bits, "text": "null below this: 0.1 · H(cell)"},
        {"bits": info.prior_bits, "text": "H(cell): the whole place, on average"},
    ]
    rules = _chart(limits).encode(y="bits:Q")
    lines = rules.mark_rule(color=SOFT, strokeDash=[4, 4])
    said = rules.mark_text(align="left", dy=-7, dx=4, color=SOFT, fontSize=11).encode(
        text="text:N", x=alt.value(0)
    )
    subtitle = (
        f"{int(lexicon.null.sum())} of {lexicon.tokens} tokens are null and carry "
        f"{_percent(info.null_messages)} of the messages; mean information {info.mutual_bits:.2f} bits"
    )
    return (lines + said + dots + names).properties(
        width=420, height=TALL, title=_title("What each token tells", subtitle)
    )


def calibration_plot(calibration: dict[str, Calibration]) -> Chart:
    """Draw likelihood of the drawn cells against the share that held a car."""
    names = {"spoke": "a car that just spoke", "all_cars": "any other car"}
    rows = [
        {"said": one.said, "seen": one.seen, "cells": one.cells, "truth": names[truth]}
        for truth, judged in calibration.items()
        for one in judged.bins
    ]
    diagonal = (
        _chart([{"said": 0, "seen": 0}, {"said": 1, "seen": 1}])
        .mark_line(color=SOFT, strokeDash=[4, 4], strokeWidth=1)
        .encode(x="said:Q", y="seen:Q")
    )
    series = _chart(rows).encode(
        x=_axis("said", "likelihood of a triangle", (0, 1)),
        y=_axis("seen", "share of these cells with a car", (0, 1)),
        color=alt.Color(
            "truth:N",
            scale=alt.Scale(domain=list(names.values()), range=[ACCENT, ORANGE]),
            legend=alt.Legend(title=None, orient="top-left", labelFontSize=12),
        ),
    )
    spoke = calibration["spoke"]
    low, high = spoke.ece_ci95
    subtitle = (
        f"cars that spoke: calibration error {spoke.ece:.3f} (95 % {low:.3f} to {high:.3f}), Brier skill "
        f"{spoke.brier_skill:.2f}, coverage {_percent(spoke.coverage)}; "
        f"{spoke.drawn:,} cells in {spoke.trials:,} trials"
    )
    marks = series.mark_point(filled=False, strokeWidth=2, opacity=1).encode(
        size=alt.Size("truth:N", scale=alt.Scale(domain=list(names.values()), range=[50, 130]), legend=None)
    )
    layers = diagonal + series.mark_line(strokeWidth=1.5) + marks
    return layers.properties(width=360, height=360, title=_title("Can the triangles be believed?", subtitle))


def _chart(rows: list[dict[str, Any]]) -> Chart:
    return alt.Chart(alt.Data(values=rows))  # type: ignore[no-untyped-call]


def _label(lexicon: Lexicon, share: Any, token: int) -> list[str]:
    mark = " (null)" if lexicon.null[token] else ""
    return [f"{token}{mark}", f"{_percent(share[token])}, {lexicon.entropy_bits[token]:.1f} bit"]


def _lookup(labels: dict[str, list[str]]) -> str:
    """Vega expression from a panel's key to its label, two lines."""
    pairs = ", ".join(f"'{key}': {lines!r}" for key, lines in labels.items())
    return f"{{{pairs}}}[datum.label]"


def _square(lexicon: Lexicon) -> tuple[tuple[float, float], tuple[float, float]]:
    """Domains of x and y with equal units and a margin."""
    low, high = lexicon.coordinates.min(axis=0), lexicon.coordinates.max(axis=0)
    middle, half = (low + high) / 2, max(float((high - low).max()) / 2 * 1.12, 1e-6)
    x, y = ((float(m - half), float(m + half)) for m in middle)
    return x, y


def _axis(field: str, title: str, domain: tuple[float, float] | None = None) -> Any:
    scale = alt.Scale(zero=False, nice=True) if domain is None else alt.Scale(domain=list(domain), nice=False)
    kind = alt.X if field in {"x", "said"} else alt.Y
    return kind(f"{field}:Q", title=title, scale=scale, axis=alt.Axis(tickCount=5))


def _kinds() -> alt.Color:
    return alt.Color(
        "kind:N", scale=alt.Scale(domain=["says where", "null"], range=[ACCENT, NULL]), legend=None
    )


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _title(text: str, subtitle: str) -> alt.TitleParams:
    return alt.TitleParams(text, subtitle=subtitle)


def _styled(chart: Chart) -> Chart:
    styled: Chart = (
        chart.configure(font=FONT, background="white", padding=16)
        .configure_view(stroke=None)
        .configure_axis(
            labelFontSize=12,
            titleFontSize=12,
            titleFontWeight="normal",
            titlePadding=10,
            labelColor=SOFT,
            titleColor=INK,
            gridColor=LINE,
            domainColor=LINE,
            tickColor=LINE,
        )
        .configure_title(
            anchor="start",
            fontSize=16,
            fontWeight=600,
            color=INK,
            subtitleColor=SOFT,
            subtitleFontSize=12,
            offset=14,
        )
    )
    return styled
