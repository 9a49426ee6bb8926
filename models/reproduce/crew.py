"""Several cells at once, each in a process of its own: ancestors first, and a failure stops nobody else."""

import subprocess
import sys
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from models.reproduce.cells import Cell, Shelf
from models.reproduce.work import Job, log_rows
from models.training.config import Recipe, RecipeError

POLL_S = 0.5
PATIENCE_S = 10.0  # for a child to leave when it is told to
ONE_THREAD = ("env", "OMP_NUM_THREADS=1", "OPENBLAS_NUM_THREADS=1", "MKL_NUM_THREADS=1")


class Step(NamedTuple):
    """A cell that has to be done."""

    cell: Cell
    recipe: Recipe
    ancestor: Cell | None


@dataclass
class Report:
    """How it went, cell by cell."""

    done: list[Cell] = field(default_factory=list)
    fresh: list[Cell] = field(default_factory=list)
    no_recipe: list[Cell] = field(default_factory=list)
    failed: dict[Cell, str] = field(default_factory=dict)

    def __str__(self) -> str:
        counts = {"done": self.done, "stored before": self.fresh, "no recipe yet": self.no_recipe}
        said = [f"{len(cells)} {what}" for what, cells in counts.items()]
        return ", ".join([*said, f"{len(self.failed)} failed"])


class Plan:
    """What has to be done for some cells: those that are missing or stale, and what they start from."""

    def __init__(self, shelf: Shelf, force: Collection[Cell], report: Report) -> None:
        self.steps: dict[Cell, Step] = {}
        self._shelf, self._force, self._report = shelf, force, report
        self._open: set[Cell] = set()

    def add(self, cell: Cell, weights: bool = False) -> bool:
        """Plan a cell, for its numbers or for its weights too; False if it cannot be had."""
        if cell in self.steps:
            return True
        if cell in self._report.failed or cell in self._report.no_recipe:
            return False
        if cell in self._open:
            return self._fails(cell, "starts from itself")
        self._open.add(cell)
        try:
            return self._add(cell, weights)
        except RecipeError as error:
            return self._fails(cell, str(error))
        finally:
            self._open.discard(cell)

    def _add(self, cell: Cell, weights: bool) -> bool:
        shelf, recipe = self._shelf, self._shelf.recipe(cell)
        if recipe is None:
            self._report.no_recipe.append(cell)
            return False
        if cell not in self._force and shelf.is_fresh(cell) and (not weights or shelf.is_trained(cell)):
            if cell not in self._report.fresh and cell not in self._report.done:
                self._report.fresh.append(cell)
            return True
        ancestor = shelf.ancestor(cell)
        if ancestor is not None and not self.add(ancestor, weights=True):
            return self._fails(cell, f"starts from {ancestor.name}, which cannot be had")
        self.steps[cell] = Step(cell, recipe, ancestor)
        return True

    def _fails(self, cell: Cell, reason: str) -> bool:
        self._report.failed.setdefault(cell, reason)
        return False


@dataclass(frozen=True, slots=True)
class Working:
    """A cell that is being worked on."""

    step: Step
    process: subprocess.Popen[bytes]
    said: Path
    """What its process prints."""
    task: TaskID

    def reason(self) -> str:
        """The last line that the process said."""
        lines = self.said.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit code {self.process.returncode}"


class Crew:
    """Works through cells, so many at once."""

    def __init__(self, shelf: Shelf, jobs: int, console: Console) -> None:
        self.shelf, self.jobs = shelf, jobs
        self.report = Report()
        self._console = console
        self._bar = Progress(
            TextColumn("{task.description}"), BarColumn(20), MofNCompleteColumn(),
            TextColumn("{task.fields[now]}"), TimeElapsedColumn(), console=console,
        )  # fmt: skip
        self._running: list[Working] = []

    def work(self, cells: Sequence[Cell], force: bool = False) -> Report:
        """Do what is missing of these cells, and of those that they start from."""
        forced = frozenset(cells) if force else frozenset[Cell]()
        with self._bar:
            while steps := self._plan(cells, forced):
                self._round(steps, forced)
                forced = frozenset()  # a second round has work only if an ancestor came out differently
        for cell in self.report.no_recipe:
            self._console.print(f"{cell.name}: no recipe yet", highlight=False)
        return self.report

    def _plan(self, cells: Sequence[Cell], forced: Collection[Cell]) -> list[Step]:
        plan, before = Plan(self.shelf, forced, self.report), set(self.report.failed)
        for cell in cells:
            plan.add(cell)
        for cell in self.report.failed.keys() - before:
            self._tell(cell, f"failed: {self.report.failed[cell]}")
        return list(plan.steps.values())

    def _round(self, steps: list[Step], forced: Collection[Cell]) -> None:
        total = self._bar.add_task("cells", total=len(steps), now="")
        waiting = list(steps)
        try:
            while waiting or self._running:
                waiting = self._begin(waiting, forced)
                time.sleep(POLL_S)
                for one in list(self._running):
                    self._look_at(one)
                self._bar.update(total, completed=len(steps) - len(waiting) - len(self._running))
        finally:
            self._dismiss()
            self._bar.remove_task(total)

    def _begin(self, waiting: list[Step], forced: Collection[Cell]) -> list[Step]:
        """Start what can be started; returns what must wait."""
        later: list[Step] = []
        for step in waiting:
            busy = {one.step.cell for one in self._running} | {other.cell for other in later}
            if step.ancestor is not None and step.ancestor in self.report.failed:
                self._failed(step.cell, f"starts from {step.ancestor.name}, which failed")
            elif len(self._running) == self.jobs or step.ancestor in busy:
                later.append(step)
            else:
                self._running.append(self._start(step, step.cell in forced))
        return later

    def _start(self, step: Step, force: bool) -> Working:
        cell, shelf = step.cell, self.shelf
        shelf.runs.mkdir(parents=True, exist_ok=True)
        said = shelf.runs / f"{cell.name}.txt"
        words = Job.of(cell, shelf, force=force, train=True).words()
        with said.open("wb") as output:
            process = subprocess.Popen(  # noqa: S603 (our own module, our own words)
                [*ONE_THREAD, sys.executable, *words], stdin=subprocess.PIPE, stdout=output, stderr=output
            )
        updates = sum(phase.updates for phase in step.recipe.phase)
        self._tell(cell, "begins")
        return Working(step, process, said, self._bar.add_task(cell.name, total=updates, now=""))

    def _look_at(self, one: Working) -> None:
        """Show how far it is, or how it ended."""
        cell = one.step.cell
        if one.process.poll() is None:
            self._bar.update(one.task, **_progress(self.shelf.run(cell)))
            return
        one.process.communicate()  # closes the pipe
        self._running.remove(one)
        self._bar.remove_task(one.task)
        if one.process.returncode:
            self._failed(cell, one.reason())
        elif not self._is_stored(cell):
            self._failed(cell, "its recipe, or its ancestor's, was changed meanwhile; run it again")
        else:
            self.report.done.append(cell)
            self._tell(cell, "done")

    def _is_stored(self, cell: Cell) -> bool:
        try:
            return self.shelf.is_fresh(cell)
        except RecipeError:
            return False

    def _failed(self, cell: Cell, reason: str) -> None:
        self.report.failed[cell] = reason
        self._tell(cell, f"failed: {reason}")

    def _tell(self, cell: Cell, words: str) -> None:
        self._console.print(f"{cell.name}: {words}", highlight=False, markup=False)

    def _dismiss(self) -> None:
        """End what still runs, when this process is told to stop; each goes on from its checkpoint later."""
        for one in self._running:
            one.process.terminate()
        for one in self._running:
            one.process.communicate(timeout=PATIENCE_S)
        self._running.clear()


def run(shelf: Shelf, jobs: int, cells: Sequence[Cell], *, force: bool = False) -> Report:
    """Work through cells, so many at once, with a display on standard error."""
    return Crew(shelf, jobs, Console(stderr=True)).work(cells, force)


def _progress(folder: Path) -> dict[str, Any]:
    """What to show of a run, from its log; nothing before its first check."""
    try:
        last = log_rows(folder)[-1]
        return {"completed": int(last["total"]), "now": f"success {float(last['success']):.3f}"}
    except (OSError, IndexError, KeyError, ValueError, TypeError):  # not there yet, or half a line
        return {}
