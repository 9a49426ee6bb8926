"""``curve.svg`` of a run: what its log says, over environment steps.

Above: success from ``init`` (and of human trials); below: the message rate with the budget. Vertical lines
begin the phases.
"""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING, Any, NamedTuple

from models.training import log

if TYPE_CHECKING:
    from pathlib import Path

    from models.training.config import Recipe

FILE = "curve.svg"
INK, SOFT, LINE, ACCENT, ORANGE = "#14181c", "#5f6973", "#dfe3e6", "#0b5a8f", "#c94c18"
FONT = "Helvetica, Arial, 'DejaVu Sans', sans-serif"
WIDTH, HEIGHT = 640, 180
_logger = logging.getLogger(__name__)

Points = list[dict[str, Any]]
"""Values of one data set: ``env_steps`` and what is drawn there."""


class Series(NamedTuple):
    """One line: column of the log, its name in the legend, colour."""

    column: str
    name: str
    color: str


SUCCESS = (
    Series("success", "success", ACCENT),
    Series("human", "human trials: no collision", ORANGE),
    Series("arrived", "human trials: arrived", SOFT),
)
RATE = (
    Series("message_rate", "message rate", ACCENT),
    Series("human_rate", "in human trials", ORANGE),
    Series("drawn_rate", "drawn in training", SOFT),
)
BUDGET = Series("", "budget", INK)


def draw(folder: Path, recipe: Recipe) -> None:
    """Write the curve of a run's folder; a curve that cannot be drawn is no reason to stop a run."""
    try:
        rows = log.read(folder)
        if rows:
            import vl_convert

            text = vl_convert.vegalite_to_svg(chart(rows, recipe))
            (folder / FILE).write_text(text + "\n", encoding="utf-8")
    except Exception as error:  # noqa: BLE001
        _logger.warning("%s was not drawn: %s", folder / FILE, error)


def chart(rows: list[log.Row], recipe: Recipe) -> dict[str, Any]:
    """The learning curve of a log that has lines, as Vega-Lite. Data are named: altair copies them slowly."""
    import altair as alt

    data = {
        "success": _points(rows, SUCCESS),
        "rate": _points(rows, RATE),
        "budget": _budgets(rows, recipe),
        "phases": _phases(rows),
    }
    above = alt.layer(*_panel(alt, data, "success", SUCCESS, "share of episodes"), _phase_names(alt))
    below = alt.layer(*_panel(alt, data, "rate", (*RATE, BUDGET), "messages per agent and step"))
    both = alt.vconcat(*(panel.properties(width=WIDTH, height=HEIGHT) for panel in (above, below)))
    title = alt.TitleParams(recipe.name, subtitle=_finding(rows))
    spec: dict[str, Any] = _styled(both.resolve_scale(color="independent").properties(title=title)).to_dict()
    return spec | {"datasets": data}


def _points(rows: list[log.Row], series: tuple[Series, ...]) -> Points:
    return [
        {"env_steps": int(row["env_steps"]), "value": float(row[one.column]), "line": one.name}
        for one in series
        for row in rows
        if not math.isnan(float(row.get(one.column) or "nan"))
    ]


def _budgets(rows: list[log.Row], recipe: Recipe) -> Points:
    budget = {phase.name: phase.budget for phase in recipe.phase if phase.budget is not None}
    return [
        {"env_steps": int(row["env_steps"]), "value": budget[row["phase"]], "line": BUDGET.name}
        for row in rows
        if row["phase"] in budget
    ]


def _phases(rows: list[log.Row]) -> Points:
    """Where each phase begins."""
    return [
        {"env_steps": int(before["env_steps"]) if before else 0, "phase": row["phase"]}
        for before, row in zip([None, *rows], rows, strict=False)
        if before is None or before["phase"] != row["phase"]
    ]


def _panel(
    alt: Any, data: dict[str, Points], name: str, series: tuple[Series, ...], unit: str
) -> tuple[Any, ...]:
    """Layers of one plot: where phases begin, the budget, the lines."""
    shown = [*data[name], *(data["budget"] if BUDGET in series else [])]
    lines = [one for one in series if any(point["line"] == one.name for point in shown)]
    lowest = min(0.9, math.floor(10 * min((point["value"] for point in shown), default=0)) / 10)
    y = alt.Y("value:Q", title=unit, scale=alt.Scale(domain=[lowest, 1]), axis=alt.Axis(tickCount=5))
    names, colors = [one.name for one in lines], [one.color for one in lines]
    legend = alt.Legend(title=None, orient="bottom", labelColor=INK)
    color = alt.Color("line:N", scale=alt.Scale(domain=names, range=colors), legend=legend, sort=names)
    layers = [_chart(alt, "phases").mark_rule(color=SOFT, strokeDash=[2, 3])]
    if BUDGET in lines:
        dashed = _chart(alt, "budget").mark_line(strokeDash=[5, 3], strokeWidth=1.2)
        layers.append(dashed.encode(y=y, color=color))
    line = _chart(alt, name).mark_line(strokeWidth=1.8, point=alt.OverlayMarkDef(size=14))
    return (*layers, line.encode(y=y, color=color))


def _chart(alt: Any, name: str) -> Any:
    """A data set over environment steps."""
    axis = alt.Axis(format="~s", tickCount=6)
    x = alt.X("env_steps:Q", title="environment steps", scale=alt.Scale(nice=False), axis=axis)
    return alt.Chart(alt.NamedData(name)).encode(x=x)


def _phase_names(alt: Any) -> Any:
    """Above the plot, beside the line."""
    names = _chart(alt, "phases").encode(text="phase:N", y=alt.value(0))
    return names.mark_text(align="left", baseline="bottom", dx=2, dy=-3, color=SOFT, fontSize=11)


def _finding(rows: list[log.Row]) -> str:
    """What was reached: the best of the last regime, and what it took."""
    last = rows[-1]
    best = next((row for row in reversed(rows) if row["best"] == "1"), last)
    return (
        f"best at update {int(best['total']):,}: success {float(best['success']):.3f}, "
        f"message rate {float(best['message_rate']):.3f}; {int(last['env_steps']):,} steps so far"
    )


def _styled(chart: Any) -> Any:
    return (
        chart.configure(font=FONT, background="white", padding=16)
        .configure_view(stroke=None)
        .configure_axis(
            labelColor=SOFT, titleColor=INK, titleFontWeight="normal",
            gridColor=LINE, domainColor=LINE, tickColor=LINE,
        )
        .configure_title(anchor="start", fontSize=16, color=INK, subtitleColor=SOFT, offset=12)
    )  # fmt: skip
