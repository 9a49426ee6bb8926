"""Export of 1,000,000 step rows: rows a second and peak memory, by `hatlab export` in a process of its own.

Half of the decisions are from Parent & Lost Child, half from Traffic Junction, in SQLite. The same command on
a hundredth of the people shows how much of the memory is the program itself.
"""

import json
import math
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks import synthetic, table
from benchmarks.served import HATLAB, Served, installed

STEPS = 1_000_000
SHARE_FEW = 100
MODELS = 8
STUDIES = ("parent-child", "traffic-junction")


class Export(NamedTuple):
    """What one run of `hatlab export` took."""

    seconds: float
    cpu_s: float
    peak_mb: float
    rows: dict[str, int]
    megabytes: float


def main() -> None:
    """Fill a database, export it, print the table."""
    lines = []
    with installed("sqlite") as house:
        for number, study in enumerate(STUDIES):
            steps = STEPS // len(STUDIES)
            begun = time.monotonic()
            first = fill(house, study, "test", steps // SHARE_FEW, first=number * 10**6)
            fill(house, study, "live", steps, first)
            table.console.print(f"{study}: {steps:,} decisions made up in {time.monotonic() - begun:.0f} s")
            lines += [line(f"{study}, few", export(house, study, "test"))]
            lines += [line(study, export(house, study, "live"))]
    table.show(
        f"Export as CSV, {STEPS:,} step rows in all",
        (
            "study",
            "step rows",
            "agent rows",
            "MB",
            "seconds",
            "CPU s",
            "step rows/s",
            "all rows/s",
            "peak MB",
        ),
        lines,
        "peak MB of the few is the program and its libraries; what the many add is what the export needs",
    )


def fill(house: Served, study: str, mode: str, steps: int, first: int) -> int:
    """Make up people until they have taken `steps` decisions; give the next free number."""
    with house.lab() as lab:
        made = synthetic.fill(lab, study, MODELS, models=MODELS, first=first, mode=mode)
        more = math.ceil(max(0, steps - made) * MODELS / made)
        synthetic.fill(lab, study, more, models=MODELS, first=first + MODELS, mode=mode)
    return first + MODELS + more


def export(house: Served, study: str, mode: str) -> Export:
    """Run the command and watch it."""
    out = house.folder / f"{study}-{mode}"
    begun = time.monotonic()
    process = subprocess.Popen(
        [*HATLAB, "export", study, "--out", str(out), "--mode", mode],
        env=house.environment,
        stdout=subprocess.DEVNULL,
    )
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"hatlab export {study}: exit status {status}")
    process.returncode = 0
    seconds = time.monotonic() - begun
    files = json.loads((out / "manifest.json").read_text())["files"]
    rows = {Path(name).stem: facts["rows"] for name, facts in files.items()}
    size = sum(facts["bytes"] for facts in files.values()) / 1e6
    return Export(seconds, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, rows, size)


def line(name: str, found: Export) -> tuple[str, ...]:
    steps, rows = found.rows["steps"], sum(found.rows.values())
    return (
        name,
        f"{steps:,}",
        f"{found.rows['agents']:,}",
        f"{found.megabytes:,.0f}",
        f"{found.seconds:.1f}",
        f"{found.cpu_s:.1f}",
        f"{steps / found.seconds:,.0f}",
        f"{rows / found.seconds:,.0f}",
        f"{found.peak_mb:.0f}",
    )


if __name__ == "__main__":
    main()
