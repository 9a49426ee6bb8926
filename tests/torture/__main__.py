"""`python -m tests.torture [--record]`: 20 kills under 20 robots, on SQLite and on PostgreSQL.

Exit 1 if anything was lost. `--record` puts the printed table into docs/measurements.md.
"""

import sys

from rich.console import Console
from rich.table import Table

from benchmarks import measurements
from benchmarks.table import machine
from tests.torture.torture import Ordeal, Report, torture

COMMAND = "make torture"
ORDEALS = (
    Ordeal("sqlite", kills=20, robots=20, trials_per_block=20, steps_between=(10, 200)),
    Ordeal("postgresql", kills=20, robots=20, trials_per_block=20, steps_between=(10, 200)),
)


def table(reports: list[Report]) -> Table:
    shown = Table(title="kill -9 under robots", title_justify="left")
    shown.add_column("")
    for report in reports:
        shown.add_column(f"{report.ordeal.database}, {report.workers} worker(s)", justify="right")
    lines = {
        "kills": [str(r.kills) for r in reports],
        "robots finished": [f"{r.finished} of {r.ordeal.robots}" for r in reports],
        "participants in the database": [str(r.participants) for r in reports],
        "steps acknowledged": [f"{r.acknowledged:,}" for r in reports],
        "acknowledged steps missing": [str(r.missing) for r in reports],
        "steps doubled": [str(r.doubled) for r in reports],
        "steps stored that nobody took": [str(r.unknown) for r in reports],
        "requests sent again": [f"{r.sent_again:,}" for r in reports],
        "median restart, s": [f"{r.restart_s:.1f}" for r in reports],
        "seconds in all": [f"{r.seconds:.0f}" for r in reports],
        "hatlab verify, exit code": [str(r.verify_exit) for r in reports],
        "clean": ["yes" if r.clean else "NO" for r in reports],
    }
    for name, values in lines.items():
        shown.add_row(name, *values)
    return shown


def main(arguments: list[str]) -> int:
    console = Console(width=100, record=True, highlight=False)
    console.print(machine())
    reports = []
    for ordeal in ORDEALS:
        reports.append(torture(ordeal))
        console.print(f"{ordeal.database}: {reports[-1].verify_said}", markup=False)
        for error in reports[-1].errors:
            console.print(error, markup=False)
    console.print(table(reports))
    if "--record" in arguments:
        measurements.record(COMMAND, console.export_text())
    return int(not all(report.clean for report in reports))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
