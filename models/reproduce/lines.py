"""What stands in a table: the stored cells of a method and task, and the figures that follow from them."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from models.reproduce.cells import Cell, Shelf
from models.reproduce.tables import SLACK, Column, Entry, Row, Table
from models.training.config import RecipeError
from models.training.convergence import Criterion, Unreached, converged

NOT_RUN, NO_RECIPE = "not run", "no recipe yet"
RATE_TOLERANCE = 0.02
"""How far from its budget an agent may talk and still count as converged; the target of our tables."""


class Number(NamedTuple):
    """Our figure, and how sure it is: over seeds the range, of one seed its 95 % interval."""

    mean: float
    low: float | None
    high: float | None
    kind: str


class Line(NamedTuple):
    """One row of the printed table, before it is printed."""

    method: str
    column: Column
    entry: Entry
    status: str
    seeds: list[int]
    wanted: int
    records: list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Stock:
    """A table and the shelf that its cells stand on."""

    table: Table
    shelf: Shelf

    def lines(self, column: Column) -> list[Line]:
        return [
            self._line(row, column, row.cells[column.key])
            for row in self.table.row
            if column.key in row.cells
        ]

    def _line(self, row: Row, column: Column, entry: Entry) -> Line:
        wanted = len(entry.seeds or column.seeds)
        if len(entry.recipes) == 1:
            return self._of(row.method, column, entry, entry.recipes[0], wanted)
        name, reason = self._smallest(column, entry)
        if name is None:
            return Line(row.method, column, entry, reason, [], wanted, [])
        line = self._of(row.method, column, entry, name, wanted)
        return line._replace(method=f"{row.method} (`{name}`)")

    def _of(self, method: str, column: Column, entry: Entry, recipe: str, wanted: int) -> Line:
        cells = [Cell(recipe, seed) for seed in entry.seeds or column.seeds]
        known = {cell: stored for cell in cells if (stored := self.known(cell)) is not None}
        return Line(
            method, column, entry, self._status(recipe), [c.seed for c in known], wanted, list(known.values())
        )

    def _status(self, *recipes: str) -> str:
        there = any((self.shelf.recipes / f"{recipe}.toml").exists() for recipe in recipes)
        return NOT_RUN if there else NO_RECIPE

    def known(self, cell: Cell) -> dict[str, Any] | None:
        """What is stored, if it is of the recipe as it stands."""
        try:
            return self.shelf.record(cell) if self.shelf.is_fresh(cell) else None
        except RecipeError:
            return None

    def _smallest(self, column: Column, entry: Entry) -> tuple[str | None, str]:
        """The recipe with the smallest budget that is nearly as good as the row it is compared with."""
        path = column.measures[0].path
        other = next(row.cells[column.key] for row in self.table.row if row.method == entry.of)
        best = number(self._of("", column, other, other.recipes[0], 0).records, path)
        found = {name: number(self._of("", column, entry, name, 0).records, path) for name in entry.recipes}
        known = {name: figure for name, figure in found.items() if figure is not None}
        if best is None or not known:
            return None, self._status(*entry.recipes)
        near = [name for name, figure in known.items() if figure.mean >= (1 - entry.within) * best.mean]
        return (near[-1], "") if near else (None, f"none within {100 * entry.within:g} %")


def number(records: Sequence[dict[str, Any]], path: str) -> Number | None:
    """Our figure of several seeds; None if nothing of it is stored."""
    found = [value for stored in records if (value := _at(stored, path)) is not None]
    means = [float(value["mean"] if isinstance(value, dict) else value) for value in found]
    if not means:
        return None
    if len(means) > 1:
        return Number(sum(means) / len(means), min(means), max(means), "range over seeds")
    only = found[0]
    low, high = only["ci95"] if isinstance(only, dict) else (None, None)
    return Number(means[0], low, high, "95 % over episodes" if isinstance(only, dict) else "")


def _at(stored: Any, path: str) -> Any:
    for key in path.split("."):
        stored = stored.get(key) if isinstance(stored, dict) else None
    return stored


def convergence(line: Line) -> list[int | Unreached]:
    """Environment steps to convergence, seed by seed; from the ancestor on, or from the first weights."""
    criterion = _criterion(line)
    if criterion is None:
        return []
    found: list[int | Unreached] = []
    for stored in line.records:
        rows = list(csv.DictReader(stored["curve"]))
        known = bool(rows) and criterion.column in rows[0]
        place = converged(rows, criterion) if known else Unreached.NEVER
        before = 0 if line.entry.additional else stored["training"]["env_steps_before"]
        found.append(place if isinstance(place, Unreached) else place.env_steps + before)
    return found


def _criterion(line: Line) -> Criterion | None:
    """The paper's figure less the slack; under a budget the message rate counts too."""
    asked = line.column.converged
    paper = None if asked is None else line.entry.paper.get(asked.paper)
    if asked is None or paper is None or not line.records:
        return None
    budget = line.records[0]["content"]["budget"]
    return Criterion(paper - SLACK, asked.column, budget if budget < 1 else None, RATE_TOLERANCE)
