"""Distance of prototypes against distance of mean locations, one point per pair of tokens."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import altair as alt
import numpy as np

from models.interpret.figures.style import ACCENT, ORANGE, TALL, Chart, axis, chart, title

if TYPE_CHECKING:
    from models.interpret.correlation import Distances, Interval

MANY = 400
"""From so many pairs on they are counted in boxes: a cloud hides where most are, and makes a large file."""
BOXES = (36, 26)
WIDE = 380


def distance_scatter(
    found: Distances, heading: str = "Does near in meaning mean near in the world?", note: str = ""
) -> Chart:
    """Draw the pairs and, where there is one, the line through them."""
    layers = _boxes(found) if len(found.pairs) > MANY else _points(found)
    if not found.reason:
        layers += _line(found)
    pairs = f"{len(found.pairs):,} pairs of tokens" + (f"; {note}" if note else "")
    return layers.properties(width=WIDE, height=TALL, title=title(heading, [_finding(found), pairs]))


def _finding(found: Distances) -> str:
    if found.reason:
        return found.reason
    return f"r² = {found.r2:.2f}{_range(found.r2_ci95)}, slope {found.slope:.2f}{_range(found.slope_ci95)}"


def _range(interval: Interval | None) -> str:
    return "" if interval is None else f" [{interval[0]:.2f}, {interval[1]:.2f}]"


def _axes(found: Distances) -> dict[str, Any]:
    most_x, most_y = (float(side.max(initial=1)) for side in (found.prototype, found.place))
    return {
        "x": axis("x", "distance between prototypes (units of the message space)", (0, 1.05 * most_x)),
        "y": axis("y", "distance between mean locations (cells)", (0, 1.08 * most_y)),
    }


def _points(found: Distances) -> Chart:
    rows = [{"x": float(x), "y": float(y)} for x, y in zip(found.prototype, found.place, strict=True)]
    return chart(rows).mark_circle(size=48, opacity=0.65, color=ACCENT).encode(**_axes(found))


def _boxes(found: Distances) -> Chart:
    """Pairs per box, darker for more."""
    limits = [(0.0, 1.05 * float(found.prototype.max())), (0.0, 1.08 * float(found.place.max()))]
    counts, x, y = np.histogram2d(found.prototype, found.place, bins=BOXES, range=limits)
    rows = [
        {"x": x[i], "x2": x[i + 1], "y": y[j], "y2": y[j + 1], "pairs": int(counts[i, j])}
        for i, j in np.argwhere(counts > 0).tolist()
    ]
    shade = alt.Color(
        "pairs:Q",
        scale=alt.Scale(type="log", range=["#c9dcea", ACCENT]),
        legend=alt.Legend(title="pairs", orient="right", gradientLength=120, tickCount=3),
    )
    return chart(rows).mark_rect().encode(**_axes(found), x2="x2:Q", y2="y2:Q", color=shade)


def _line(found: Distances) -> Chart:
    ends = [
        {"x": x, "y": found.intercept + found.slope * x}
        for x in (float(found.prototype.min()), float(found.prototype.max()))
    ]
    return chart(ends).mark_line(color=ORANGE, strokeWidth=2, clip=True).encode(x="x:Q", y="y:Q")
