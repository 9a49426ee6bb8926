"""`python -m tests.torture [--record] [NAME …]`: 20 kills under 20 robots, on SQLite and on PostgreSQL; and a
whole study of 250 people through a made-up marketplace, on PostgreSQL with two workers, under 10 kills.

NAME is sqlite, postgresql or marketplace; all of them by default. Exit 1 if anything was lost.
`--record` puts the printed table into docs/measurements.md.
"""

import sys

from rich.console import Console
from rich.table import Table

from benchmarks import measurements
from benchmarks.table import machine
from tests.torture import recruited
from tests.torture.recruited import Settled, ordeal_by_marketplace
from tests.torture.torture import Ordeal, Report, torture

COMMAND = "make torture"
MODULE = ".venv/bin/python -m tests.torture"
ORDEALS = (
    Ordeal("sqlite", kills=20, robots=20, trials_per_block=20, steps_between=(10, 200)),
    Ordeal("postgresql", kills=20, robots=20, trials_per_block=20, steps_between=(10, 200)),
)

MARKETPLACE = recruited.Ordeal(
    "postgresql",
    kills=10,
    finishing={"traffic-junction": 126, "parent-child": 76},
    dropouts=48,
    trials_per_block=20,
    steps_between=(2_000, 4_000),
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


def marketplace_table(report: Report, settled: Settled) -> Table:
    shown = Table(title="a study through a made-up Prolific, kill -9 meanwhile", title_justify="left")
    shown.add_column("")
    shown.add_column(f"{report.ordeal.database}, {report.workers} worker(s)", justify="right")
    for name, value in {
        "kills": f"{report.kills}",
        "people": f"{report.participants}",
        "how they ended": ", ".join(f"{n} {status}" for status, n in sorted(settled.statuses.items())),
        "steps acknowledged": f"{report.acknowledged:,}",
        "acknowledged steps missing": f"{report.missing}",
        "steps doubled": f"{report.doubled}",
        "steps stored that nobody took": f"{report.unknown}",
        "requests sent again": f"{report.sent_again:,}",
        "payments at the marketplace": f"{settled.payments}",
        "people paid exactly what is owed": f"{settled.paid_once}",
        "people paid otherwise": f"{len(settled.wrong)}",
        "differences left that can be settled": f"{settled.left_to_do}",
        "seconds in all": f"{report.seconds:.0f}",
        "hatlab verify, exit code": f"{report.verify_exit}",
        "clean": "yes" if is_clean(report, settled) else "NO",
    }.items():
        shown.add_row(name, value)
    return shown


def is_clean(report: Report, settled: Settled) -> bool:
    lost = report.missing + report.doubled + report.unknown + report.stale + len(report.errors)
    return not lost and not settled.wrong and not settled.left_to_do and report.verify_exit == 0


def main(arguments: list[str]) -> int:
    console = Console(width=100, record=True, highlight=False)
    console.print(machine())
    names = [each for each in arguments if not each.startswith("-")]
    clean, reports = [], []
    for ordeal in ORDEALS:
        if not names or ordeal.database in names:
            reports.append(torture(ordeal))
            say(console, ordeal.database, reports[-1])
    if reports:
        console.print(table(reports))
        clean += [report.clean for report in reports]
    if not names or "marketplace" in names:
        report, settled = ordeal_by_marketplace(MARKETPLACE)
        say(console, "marketplace", report)
        for line in settled.wrong:
            console.print(line, markup=False)
        console.print(marketplace_table(report, settled))
        clean.append(is_clean(report, settled))
    if "--record" in arguments:
        command = " ".join([MODULE, *names]) if names else COMMAND
        measurements.record(command, console.export_text())
    return int(not all(clean))


def say(console: Console, name: str, report: Report) -> None:
    console.print(f"{name}: {report.verify_said}", markup=False)
    for error in report.errors:
        console.print(error, markup=False)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
