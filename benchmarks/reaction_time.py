"""Accuracy of rt_ms against known key delays, idle and busy, beside jsPsych's own keyboard rt.

One key press is measured by both at once in headless Chromium. The error is the measured time minus the delay
between the page's signal at the DOM write and the dispatch of the key; both carry the few milliseconds that
signal and key travel between processes, so that differences between rows say more than any one mean.
"""

import json
import shutil
import statistics
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks import table

ROOT = Path(__file__).parents[1]
ROUNDS = 40
LIMIT_S = 300
METHODS = {"hatlab": "hatlab (event time stamp)", "jspsych": "jsPsych 8.3.0 getKeyboardResponse"}


def main() -> int:
    """Measure, print the table; give the exit code."""
    node = shutil.which("node")
    if node is None or not (ROOT / "node_modules" / "playwright-core").is_dir():
        print("reaction_time needs Node 20 and `npm ci`", file=sys.stderr)
        return 2
    done = subprocess.run(
        (node, "benchmarks/browser/reaction_time.mjs", str(ROUNDS)),
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    if done.returncode:
        return 1
    presses = [json.loads(text) for text in done.stdout.splitlines()]
    table.show(
        f"Error of a measured reaction time, ms ({ROUNDS} key presses a row at delays of 150 to 450 ms)",
        ("method", "main thread", "median", "mean", "SD", "largest", "handler lag median"),
        [row(presses, load, method) for load in ("idle", "busy") for method in METHODS],
        "busy: pieces of 5-45 ms of work with gaps of 5-15 ms. Error = measured - delay kept by the driver.",
    )
    return 0


def row(presses: Sequence[dict[str, float | str]], load: str, method: str) -> tuple[str, ...]:
    """One method under one load."""
    mine = [press for press in presses if press["load"] == load]
    errors = [float(press[method]) - float(press["delay_ms"]) for press in mine]
    lag = statistics.median(float(press["lag"]) for press in mine)
    figures = (
        statistics.median(errors),
        statistics.fmean(errors),
        statistics.stdev(errors),
        max(errors, key=abs),
        lag,
    )
    return (METHODS[method], load, *(f"{figure:.1f}" for figure in figures))


if __name__ == "__main__":
    sys.exit(main())
