"""One cell in a process of its own: train (or go on), measure, store. Killed at any time, it goes on later.

python -m models.reproduce.work '{"recipe": "easy-fixed-cts", "seed": 1, ...}'
"""

import csv
import fcntl
import json
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from models import card, training
from models.policies import bundle
from models.reproduce.cells import Cell, Shelf, same_recipe
from models.reproduce.views import meaning, views
from models.training import checkpoint, held
from models.training.config import Recipe, RecipeError
from models.training.trainer import fingerprint

BOOK = "cell.json"
"""In the run's folder: the weights that it started from."""
NICE = 10
CURVE = ("total", "env_steps", "success", "reward", "message_rate", "drawn_rate")
COSTS = ("env_steps", "cpu_minutes")
REFUSED = 2
REFUSALS = (
    RecipeError,
    training.TrainingError,
    held.RunError,
    checkpoint.CheckpointError,
    bundle.BundleError,
    OSError,
)


@dataclass(frozen=True, slots=True)
class Job:
    """What a process is told."""

    recipe: str
    seed: int
    recipes: str
    runs: str
    records: str
    bundles: str
    episodes: int
    force: bool
    """Train anew, whatever there is."""
    train: bool
    """Weights are needed, even if the numbers are stored already."""

    @classmethod
    def of(cls, cell: Cell, shelf: Shelf, *, force: bool = False, train: bool = False) -> "Job":
        recipes, runs, records, bundles = (str(path.absolute()) for path in shelf.places)
        return cls(*cell, recipes, runs, records, bundles, shelf.episodes, force, train)

    @property
    def cell(self) -> Cell:
        return Cell(self.recipe, self.seed)

    @property
    def shelf(self) -> Shelf:
        recipes, runs, records, bundles = map(Path, (self.recipes, self.runs, self.records, self.bundles))
        return Shelf(recipes, runs, records, bundles, self.episodes)

    def words(self) -> list[str]:
        return ["-m", "models.reproduce.work", json.dumps(asdict(self))]


def do(job: Job) -> None:
    """Train, measure and store one cell, unless another process has done so meanwhile."""
    shelf, cell = job.shelf, job.cell
    shelf.runs.mkdir(parents=True, exist_ok=True)
    with _alone(shelf.runs / f"{cell.name}.lock"):
        if shelf.is_fresh(cell) and not job.force and (shelf.is_trained(cell) or not job.train):
            return
        recipe, start = shelf.recipe(cell), shelf.start(cell)
        if recipe is None:
            raise RecipeError(f"{cell.recipe}: no recipe yet")
        if job.force or not _goes_on(shelf.run(cell), recipe, start):
            _set_aside(shelf.run(cell))
        _train(shelf, cell, start)
        _store(shelf, cell, record(shelf, cell, recipe))


def _goes_on(folder: Path, recipe: Recipe, start: str | None) -> bool:
    """Whether the folder is of this recipe and these first weights, or empty."""
    if not checkpoint.exists(folder) or not (folder / held.RECIPE).exists():
        return True
    try:
        content = training.config.load(folder / held.RECIPE).model_dump(mode="json")
    except RecipeError:
        return False
    return same_recipe(content, recipe) and _book(folder).get("start", start) == start


def _set_aside(folder: Path) -> None:
    """Keep what another recipe made, under the next free name."""
    if not folder.exists():
        return
    number = 1
    while (free := folder.with_name(f"{folder.name}.old{number}")).exists():
        number += 1
    folder.rename(free)


def _train(shelf: Shelf, cell: Cell, start: str | None) -> None:
    folder = shelf.run(cell)
    folder.mkdir(parents=True, exist_ok=True)
    if not checkpoint.exists(folder) or not (folder / held.RECIPE).exists():
        text = (shelf.recipes / f"{cell.recipe}.toml").read_text(encoding="utf-8")
        (folder / held.RECIPE).write_text(held.with_seed(text, cell.seed), encoding="utf-8")
        held.Provenance.here().write(folder)
    if (folder / checkpoint.FILE).exists() and checkpoint.read(folder).facts["finished"]:
        return
    _replace(folder / BOOK, json.dumps({"start": start}) + "\n")
    training.run(folder / held.RECIPE, folder, resume=True, progress=False, bundles=shelf.bundles)


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Wait until no other process works on this cell."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _book(folder: Path) -> dict[str, Any]:
    path = folder / BOOK
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _replace(path: Path, text: str) -> None:
    """Write a file as a whole or not at all."""
    new = path.with_name(path.name + ".new")
    new.write_text(text, encoding="utf-8")
    new.replace(path)


def record(shelf: Shelf, cell: Cell, recipe: Recipe) -> dict[str, Any]:
    """Measure a finished run and say everything that a table may ask about it."""
    folder = shelf.run(cell)
    run = held.read(folder)
    rows = log_rows(folder)
    content = recipe.model_dump(mode="json")
    return {
        "recipe": cell.recipe,
        "seed": cell.seed,
        "task": recipe.task,
        "warm_start": recipe.warm_start,
        "supervised_help": card.supervised_help(content),
        "date": datetime.now(UTC).date().isoformat(),
        "git_commit": held.Provenance.read(folder).git_commit,
        "fingerprint": fingerprint(recipe),
        "start": shelf.start(cell),
        "weights": held.weights_sha256(run.policy.weights()),
        "episodes": shelf.episodes,
        "training": cost(shelf, cell, recipe, run, rows),
        "views": views(recipe, run.policy, shelf.episodes),
        "meaning": meaning(recipe, run.policy),
        "drawn_rate": drawn_rate(recipe, rows),
        "curve": curve(rows),
        "content": content,
    }


def cost(
    shelf: Shelf, cell: Cell, recipe: Recipe, run: held.Run, rows: list[dict[str, str]]
) -> dict[str, Any]:
    """Environment steps and CPU minutes: of this run, and with those of the agents that it starts from."""
    cpu_s = rows[-1].get("cpu_s")  # the log of version 0.1 does not know
    minutes = round(float(cpu_s) / 60, 2) if cpu_s else None
    own = {"updates": run.updates, "env_steps": run.steps, "cpu_minutes": minutes}
    before: dict[str, Any] = {"env_steps_before": 0, "cpu_minutes_before": 0.0}
    ancestor = shelf.ancestor(cell)
    if ancestor is not None:
        first = (shelf.record(ancestor) or {})["training"]
        before = {
            f"{key}_before": first[key] + first[f"{key}_before"] for key in ("env_steps", "cpu_minutes")
        }
    elif recipe.init_from is not None:
        steps = bundle.load(shelf.bundles / recipe.init_from).manifest.steps_trained
        before = {"env_steps_before": steps, "cpu_minutes_before": None}  # a bundle does not know
    return own | before


def drawn_rate(recipe: Recipe, rows: list[dict[str, str]]) -> float | None:
    """Share of messages that the kept agent's drawn gates sent in training; None without a budget.

    Beside the greedy rate, which a threshold holds at the budget whatever was learned, it shows an Enforcer
    that does nothing.
    """
    if recipe.phase[-1].budget is None:
        return None
    kept = [row.get("drawn_rate") for row in rows if row["best"] == "1"]
    return float(kept[-1]) if kept and kept[-1] else None


def _sum(*parts: float | None) -> float | None:
    known = [part for part in parts if part is not None]
    return sum(known) if len(known) == len(parts) else None


def log_rows(folder: Path) -> list[dict[str, str]]:
    with (folder / held.LOG).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def curve(rows: list[dict[str, str]]) -> list[str]:
    """The learning curve as lines of CSV, which convergence is read from; a column may be missing."""
    columns = [name for name in CURVE if name in rows[0]]
    return [",".join(columns), *(",".join(row[name] for name in columns) for row in rows)]


def _store(shelf: Shelf, cell: Cell, stored: dict[str, Any]) -> None:
    shelf.records.mkdir(parents=True, exist_ok=True)
    text = json.dumps(stored, indent=1, allow_nan=False, ensure_ascii=False)
    _replace(shelf.record_path(cell), text + "\n")


def end_with_parent() -> None:
    """Leave when the process that started this one ends, however it ends: its pipe then closes."""

    def watch() -> None:
        while os.read(0, 1):  # not sys.stdin, whose lock would be held when this process ends
            pass
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def main(words: list[str]) -> int:
    """Do one job, gently; one line on standard error if it cannot be done."""
    job = Job(**json.loads(words[0]))
    end_with_parent()
    os.nice(NICE)
    try:
        do(job)
    except REFUSALS as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
