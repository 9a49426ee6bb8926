"""One trained agent of a table: recipe and seed, what it starts from, and what is stored about it."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from models.policies.bundle import WEIGHTS
from models.training import checkpoint, config, held
from models.training.config import Recipe, RecipeError

EVALUATION_SEED = 7
"""As of `hatlab release`: the same episodes for every agent."""


class Cell(NamedTuple):
    """A recipe, by the name of its file, and a seed."""

    recipe: str
    seed: int

    @property
    def name(self) -> str:
        return f"{self.recipe}-{self.seed}"


@dataclass(frozen=True, slots=True)
class Shelf:
    """Where everything lives: recipes, runs, stored cells, bundles; and how much each cell is measured."""

    recipes: Path
    runs: Path
    records: Path
    bundles: Path
    episodes: int

    @property
    def places(self) -> tuple[Path, Path, Path, Path]:
        return self.recipes, self.runs, self.records, self.bundles

    def recipe(self, cell: Cell) -> Recipe | None:
        """The recipe with the cell's seed; None if nobody has written it yet.

        Raises:
            RecipeError: it is wrong.
        """
        path = self.recipes / f"{cell.recipe}.toml"
        if not path.exists():
            return None
        return config.load(path).model_copy(update={"seed": cell.seed})

    def run(self, cell: Cell) -> Path:
        return self.runs / cell.name

    def record_path(self, cell: Cell) -> Path:
        return self.records / f"{cell.name}.json"

    def record(self, cell: Cell) -> dict[str, Any] | None:
        """What is stored about the cell; None if nothing is, or nothing that can be read."""
        try:
            stored = json.loads(self.record_path(cell).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return stored if isinstance(stored, dict) else None

    def ancestor(self, cell: Cell) -> Cell | None:
        """The cell whose run this one starts from."""
        recipe = self.recipe(cell)
        if recipe is None or recipe.init_from is None or not recipe.init_from.startswith(held.ANCESTOR):
            return None
        return Cell(recipe.init_from.removeprefix(held.ANCESTOR), cell.seed)

    def start(self, cell: Cell) -> str | None:
        """Name (sha256) of the weights that the cell starts from; None for chance, "" if they are missing."""
        ancestor, recipe = self.ancestor(cell), self.recipe(cell)
        if ancestor is not None:
            return str((self.record(ancestor) or {}).get("weights", ""))
        if recipe is None or recipe.init_from is None:
            return None
        path = self.bundles / recipe.init_from / WEIGHTS
        return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""

    def is_fresh(self, cell: Cell) -> bool:
        """Whether what is stored is of this recipe, these first weights and so many episodes."""
        stored, recipe, ancestor = self.record(cell), self.recipe(cell), self.ancestor(cell)
        if stored is None or recipe is None or (ancestor is not None and not self.is_fresh(ancestor)):
            return False
        kept = stored.get("start"), stored.get("episodes")
        return same_recipe(stored.get("content"), recipe) and kept == (self.start(cell), self.episodes)

    def is_trained(self, cell: Cell) -> bool:
        """Whether the run's folder holds the finished training that is stored."""
        try:
            run = held.read(self.run(cell))
        except (held.RunError, RecipeError, checkpoint.CheckpointError):
            return False
        stored = self.record(cell) or {}
        return run.finished and held.weights_sha256(run.policy.weights()) == stored.get("weights")


def same_recipe(content: Any, recipe: Recipe) -> bool:
    """Whether a stored recipe asks for the same; a field that came later counts with its default."""
    try:
        return config.parse(content) == recipe
    except RecipeError:
        return False
