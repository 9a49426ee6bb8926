"""A table of the paper as data: which agents it needs, how they are measured, and what the paper says.

A file of `models/tables`: `[[column]]` is a task with its measures, `[[row]]` a method, with a cell per task.
"""

import tomllib
from fnmatch import fnmatch
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from models.reproduce.cells import Cell

PACKAGED = Path(__file__).parent.parent / "tables"
EPOCH_STEPS = 80_000
"""Environment steps of one epoch, as the paper and its code count."""
SLACK = 0.01
"""What an evaluation may lack to the paper's figure and still hold the criterion of convergence."""

Count = Annotated[int, Field(ge=1)]


class TableError(Exception):
    """There is no such table, or its file is wrong. One line."""


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class Shown(_Strict):
    """One number of a cell."""

    path: str
    """Where it stands in the cell's file, such as `views.greedy.success`."""
    title: str
    digits: Annotated[int, Field(ge=0)] = 3


class Converges(_Strict):
    """When training counts as converged."""

    column: str
    """Of log.csv."""
    paper: str
    """Path of the figure of the paper that it must not fall below by more than `SLACK`."""


class Column(_Strict):
    """A task."""

    key: Annotated[str, Field(pattern=r"^[a-z0-9-]+$")]
    title: str
    seeds: Annotated[tuple[int, ...], Field(min_length=1)]
    """Seeds of every cell that names no others."""
    measures: Annotated[tuple[Shown, ...], Field(min_length=1)]
    converged: Converges | None = None


class Entry(_Strict):
    """What stands where a row meets a column."""

    recipe: str | tuple[str, ...]
    """A file of models/recipes, without `.toml`. Several: from the largest budget to the smallest, of which
    the last one within `within` of the row `of` is shown.
    """
    seeds: tuple[int, ...] | None = None
    paper: dict[str, float] = {}
    """The paper's figures, by path."""
    epochs: float | None = None
    """The paper's convergence, in epochs."""
    additional: bool = False
    """Those epochs, and our steps, count from the agent that it starts from."""
    public_cpu_minutes: float | None = None
    """What the public code takes on one core of the machine the table was planned on."""
    of: str | None = None
    within: float = 0.02

    @property
    def recipes(self) -> tuple[str, ...]:
        return (self.recipe,) if isinstance(self.recipe, str) else self.recipe


class Row(_Strict):
    """A method."""

    method: str
    cells: dict[str, Entry]
    """By key of the column."""


class Table(_Strict):
    """A whole file."""

    name: str = ""
    title: str
    text: str
    """What a reader must know, in Markdown."""
    episodes: Count = 10_000
    """Of every evaluation."""
    column: Annotated[tuple[Column, ...], Field(min_length=1)]
    row: Annotated[tuple[Row, ...], Field(min_length=1)]

    def entry_cells(self, column: Column, entry: Entry) -> list[Cell]:
        """Agents that one entry needs."""
        seeds = entry.seeds or column.seeds
        return [Cell(recipe, seed) for recipe in entry.recipes for seed in seeds]

    def cells(self, only: str = "*", seeds: tuple[int, ...] | None = None) -> list[Cell]:
        """Agents whose recipe (or recipe-seed) fits a pattern, each once, in order of the table."""
        every = [
            cell
            for column in self.column
            for row in self.row
            if column.key in row.cells
            for cell in self.entry_cells(column, row.cells[column.key])
        ]
        fits = [
            cell for cell in dict.fromkeys(every) if (fnmatch(cell.recipe, only) or fnmatch(cell.name, only))
        ]
        return [cell for cell in fits if seeds is None or cell.seed in seeds]


def load(name: str) -> Table:
    """Read a packaged table by name, or a file.

    Raises:
        TableError: there is none, or it is wrong.
    """
    path = Path(name) if name.endswith(".toml") else PACKAGED / f"{name}.toml"
    if not path.exists():
        known = ", ".join(sorted(file.stem for file in PACKAGED.glob("*.toml")))
        raise TableError(f"{name}: no such table; there are {known}")
    try:
        table = Table.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise TableError(f"{path.name}: not TOML ({error})") from None
    except ValidationError as error:
        first = error.errors()[0]
        raise TableError(
            f"{path.name}: {'.'.join(str(part) for part in first['loc'])}: {first['msg']}"
        ) from None
    return table.model_copy(update={"name": path.stem})
