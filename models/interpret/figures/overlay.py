"""Likelihood of triangles against cars that were there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import altair as alt

from models.interpret.figures.style import ACCENT, ORANGE, SOFT, Chart, axis, chart, percent, title

if TYPE_CHECKING:
    from models.interpret.calibration import Calibration


def calibration_plot(calibration: dict[str, Calibration]) -> Chart:
    """Draw likelihood of the drawn cells against the share that held a car."""
    names = {"spoke": "a car that just spoke", "all_cars": "any other car"}
    rows = [
        {"said": one.said, "seen": one.seen, "cells": one.cells, "truth": names[truth]}
        for truth, judged in calibration.items()
        for one in judged.bins
    ]
    diagonal = (
        chart([{"said": 0, "seen": 0}, {"said": 1, "seen": 1}])
        .mark_line(color=SOFT, strokeDash=[4, 4], strokeWidth=1)
        .encode(x="said:Q", y="seen:Q")
    )
    series = chart(rows).encode(
        x=axis("said", "likelihood of a triangle", (0, 1)),
        y=axis("seen", "share of these cells with a car", (0, 1)),
        color=alt.Color(
            "truth:N",
            scale=alt.Scale(domain=list(names.values()), range=[ACCENT, ORANGE]),
            legend=alt.Legend(title=None, orient="top-left", labelFontSize=12),
        ),
    )
    spoke = calibration["spoke"]
    low, high = spoke.ece_ci95
    claims = f"{spoke.drawn:,} cells in {spoke.trials:,} trials, Brier score {spoke.brier:.4f}"
    subtitle = [
        f"cars that spoke: calibration error {spoke.ece:.3f} (95 % {low:.3f} to {high:.3f})",
        f"Brier skill {spoke.brier_skill:.2f}, coverage {percent(spoke.coverage)}; {claims}",
    ]
    marks = series.mark_point(filled=False, strokeWidth=2, opacity=1).encode(
        size=alt.Size("truth:N", scale=alt.Scale(domain=list(names.values()), range=[50, 130]), legend=None)
    )
    layers = diagonal + series.mark_line(strokeWidth=1.5) + marks
    return layers.properties(width=360, height=360, title=title("Can the triangles be believed?", subtitle))
