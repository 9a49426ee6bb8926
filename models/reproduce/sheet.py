"""A table as CSV: one line per task, method and measure."""

import csv
import io
from collections.abc import Sequence
from typing import Any

from models.reproduce.lines import Line, Stock, convergence, number
from models.reproduce.tables import EPOCH_STEPS, Shown, Table

COLUMNS = (
    "table", "task", "method", "recipe", "measure", "status", "paper", "ours", "low", "high", "interval", "n",
    "seeds", "converged_paper_env_steps", "converged_env_steps", "env_steps", "env_steps_before",
    "cpu_minutes", "cpu_minutes_before", "public_cpu_minutes", "warm_start", "supervised_help",
)  # fmt: skip


def sheet(stock: Stock) -> str:
    """Print the whole table."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(COLUMNS)
    for column in stock.table.column:
        for line in stock.lines(column):
            writer.writerows(_rows(stock.table, line))
    return file.getvalue()


def _rows(table: Table, line: Line) -> list[list[Any]]:
    return [[*_figures(table, line, shown), *_costs(line)] for shown in line.column.measures]


def _figures(table: Table, line: Line, shown: Shown) -> list[Any]:
    figure = number(line.records, shown.path)
    recipe = line.records[0]["recipe"] if line.records else " ".join(line.entry.recipes)
    status = "run" if line.records else line.status
    ours = ["", "", "", ""] if figure is None else list(figure)
    paper = line.entry.paper.get(shown.path, "")
    seeds = " ".join(map(str, line.seeds))
    what = [table.name, line.column.key, line.method, recipe, shown.path, status]
    return [*what, paper, *ours, len(line.seeds), seeds]


def _costs(line: Line) -> list[Any]:
    entry, records = line.entry, line.records
    paper = "" if entry.epochs is None else round(entry.epochs * EPOCH_STEPS)
    steps = " ".join(str(value).replace(" ", "-") for value in convergence(line))
    keys = ("env_steps", "env_steps_before", "cpu_minutes", "cpu_minutes_before")
    costs = [_mean([stored["training"][key] for stored in records]) for key in keys]
    first = records[0] if records else {"warm_start": "", "supervised_help": ""}
    public = "" if entry.public_cpu_minutes is None else entry.public_cpu_minutes
    return [paper, steps, *costs, public, first["warm_start"] or "", first["supervised_help"]]


def _mean(values: Sequence[float | None]) -> float | str:
    known = [value for value in values if value is not None]
    return round(sum(known) / len(known), 2) if known and len(known) == len(values) else ""
