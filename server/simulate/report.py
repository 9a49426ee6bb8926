"""A run of robots for the command line: a progress bar, then a table."""

from collections.abc import Callable
from dataclasses import replace

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from server.simulate.crowd import Crowd, Summary, simulate, summary
from server.simulate.robot import Result

ERRORS_SHOWN = 5


def run(crowd: Crowd, sign: Callable[[], str], console: Console) -> bool:
    """Run the robots, print the table; give whether all of them finished.

    Raises:
        UnreachableError: no hatlab server answers at the address.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("robots", total=crowd.participants)

        def done(_: Result) -> None:
            progress.advance(task)

        results = simulate(replace(crowd, concurrency=min(crowd.concurrency, crowd.participants)), sign, done)
    found = summary(results)
    console.print(table(crowd, found))
    for error in found.errors[:ERRORS_SHOWN]:
        console.print(error, style="red", markup=False, highlight=False)
    if len(found.errors) > ERRORS_SHOWN:
        console.print(f"… and {len(found.errors) - ERRORS_SHOWN} more")
    return found.complete


def table(crowd: Crowd, found: Summary) -> Table:
    """Lay the figures out, one line each."""
    shown = Table("robots", crowd.slug, title_justify="left")
    shown.columns[1].justify = "right"
    share = f"{found.successes / found.rounds:.1%}" if found.rounds else "-"
    for name, value in (
        ("style, seed", f"{crowd.style}, {crowd.seed}"),
        ("finished", f"{found.finished} of {found.participants}"),
        ("rounds", f"{found.rounds:,}"),
        ("success", share),
        ("steps", f"{found.steps:,}"),
        ("requests sent again", f"{found.retries:,}"),
        ("latency of a step, median", f"{found.latency_median_ms:.1f} ms"),
        ("latency of a step, p99", f"{found.latency_p99_ms:.1f} ms"),
    ):
        shown.add_row(name, value)
    return shown
