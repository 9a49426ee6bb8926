"""What agents say and do on their way: message rate along the route, gas or brake by token."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import altair as alt
import numpy as np

from models.interpret.figures.style import (
    ACCENT,
    DASHES,
    INK,
    SERIES,
    SHAPES,
    SOFT,
    TALL,
    Chart,
    axis,
    chart,
    percent,
    title,
)

if TYPE_CHECKING:
    from models.envs.traffic_junction import TrafficJunction
    from models.interpret.along import Along
    from models.interpret.deeds import Deeds

NAMED = 8
"""Tokens that are named in the picture of gas and brake: those whose speakers brake most."""


def rate_along_route(env: TrafficJunction, agents: dict[str, Along]) -> Chart:
    """Draw the message rate by place on the route, one line per agent, with 95 % bands."""
    names, legend = list(agents), alt.Legend(title=None, orient="top", labelFontSize=12, symbolSize=90)

    def by_name(kind: Any, values: tuple[Any, ...], legend: alt.Legend | None = legend) -> Any:
        scale = alt.Scale(domain=names, range=list(values[: len(names)]))
        return kind("agent:N", scale=scale, legend=None if len(names) == 1 else legend)

    base = chart([row for name, way in agents.items() for row in _places(name, way)]).encode(
        x=axis("place", "cells driven since the entrance"),
        y=alt.Y("rate:Q", title="messages per step of a car", **_shares()),
        color=by_name(alt.Color, SERIES),
    )
    lines = base.mark_line(strokeWidth=2).encode(strokeDash=by_name(alt.StrokeDash, DASHES, None))
    points = base.mark_point(filled=True, size=45, opacity=1).encode(shape=by_name(alt.Shape, SHAPES))
    bands = alt.layer(
        *(
            chart(_places(name, way))
            .mark_area(opacity=0.2, color=colour)
            .encode(x="place:Q", y="low:Q", y2="high:Q")
            for (name, way), colour in zip(agents.items(), SERIES, strict=False)
        )
    )
    heading = title("When do agents speak on their way?", [_entering(agents), _mean(agents)])
    return (_crossing(env) + bands + lines + points).properties(width=480, height=TALL, title=heading)


def _places(name: str, way: Along) -> list[dict[str, Any]]:
    return [
        {"agent": name, "place": place, "rate": rate.mean, "low": rate.ci95[0], "high": rate.ci95[1]}
        for place, rate in way.positions.items()
    ]


def _shares() -> dict[str, Any]:
    """An axis from 0 to 100 % with a little room above."""
    return {
        "axis": alt.Axis(format="%", values=[0, 0.25, 0.5, 0.75, 1]),
        "scale": alt.Scale(domain=[0, 1.06], nice=False),
    }


def _crossing(env: TrafficJunction) -> Chart:
    """Where on some route the lanes cross."""
    inside = np.isin(env.route_cells, env.roads.junction_cells)  # (R, L)
    inside &= np.arange(inside.shape[1]) < env.route_length[:, None]
    places = np.flatnonzero(inside.any(axis=0))
    first, last = float(places.min()), float(places.max())
    rows = [{"place": first - 0.5, "end": last + 0.5, "text": "lanes cross", "y": 1.06}]
    base = chart(rows).encode(x="place:Q")
    band = base.mark_rect(color="#eef1f3").encode(x2="end:Q")
    name = base.mark_text(align="left", dx=4, dy=8, fontSize=11, color=SOFT).encode(y="y:Q", text="text:N")
    return band + name


def _entering(agents: dict[str, Along]) -> str:
    said = [_of(name, agents, way.entering.mean) for name, way in agents.items() if way.entering]
    return f"in the step in which a car appears: {', '.join(said) or 'no car appeared'}"


def _mean(agents: dict[str, Along]) -> str:
    return f"over all steps: {', '.join(_of(name, agents, way.overall.mean) for name, way in agents.items())}"


def _of(name: str, agents: dict[str, Along], rate: float) -> str:
    return percent(rate) if len(agents) == 1 else f"{name}: {percent(rate)}"


def gas_by_token(deeds: Deeds) -> Chart:
    """Draw P(gas | token) against how often the token is said."""
    total = max(int(deeds.uses.sum()), 1)
    rows: list[dict[str, Any]] = [
        {"token": str(token), "share": float(deeds.uses[token] / total), "gas": float(deeds.gas[token])}
        for token in np.flatnonzero(deeds.uses).tolist()
    ]
    base = chart(rows).encode(
        x=alt.X("share:Q", title="share of messages", axis=alt.Axis(format="%", tickCount=5)),
        y=alt.Y("gas:Q", title="speakers that gas in the same step", **_shares()),
    )
    used = sorted((row for row in rows if row["share"] >= 0.002), key=lambda row: (row["gas"], row["token"]))
    names = (
        chart(used[:NAMED])
        .mark_text(dx=8, align="left", fontSize=11, color=INK)
        .encode(x="share:Q", y="gas:Q", text="token:N")
    )
    overall = chart([{"gas": deeds.gas_overall}]).mark_rule(color=SOFT, strokeDash=[4, 4]).encode(y="gas:Q")
    told = (
        f"the token tells {deeds.token.bits:.2f} of the {deeds.token.entropy_bits:.2f} bits, the cell alone "
        f"{deeds.cell.bits:.2f}, the token beyond the cell {deeds.beyond_cell_bits:.2f}"
    )
    subtitle = [told, f"dashed: all messages, {percent(deeds.gas_overall)} gas"]
    return (overall + base.mark_circle(size=70, opacity=0.7, color=ACCENT) + names).properties(
        width=480, height=TALL, title=title("Does the token tell gas from brake?", subtitle)
    )
