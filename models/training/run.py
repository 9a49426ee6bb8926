"""Follow a recipe from the first update to the best policy."""

from dataclasses import dataclass
from pathlib import Path

import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from models.policies.recurrent import RecurrentPolicy
from models.training import config
from models.training.allocation import keep_freed_memory
from models.training.config import Recipe
from models.training.trainer import Trainer

PACKAGED = Path(__file__).parent.parent / "bundles"


@dataclass(frozen=True, slots=True)
class TrainingResult:
    """What a finished run hands over to evaluation, interpretation and release."""

    recipe: Recipe
    policy: RecurrentPolicy
    """The best by held-out checks, in the rules of the last phase."""
    score: float
    updates: int
    steps: int
    """Environment steps trained on."""
    folder: Path


def run(
    recipe_path: Path | str,
    out_dir: Path | str,
    resume: bool = False,
    progress: bool = True,
    bundles: Path | str | None = None,
) -> TrainingResult:
    """Train what a recipe describes.

    Args:
        recipe_path: TOML file.
        out_dir: folder of the run.
        resume: go on from the folder's checkpoint if there is one.
        progress: draw a progress bar on standard error.
        bundles: where ``init_from`` is looked up; the packaged bundles if absent.

    Raises:
        RecipeError: the recipe is wrong.
        TrainingError: the folder holds another run, the start is missing, or the loss is not finite.
        CheckpointError: the checkpoint is damaged.
    """
    recipe = config.load(recipe_path)
    torch.set_num_threads(1)
    keep_freed_memory()
    trainer = Trainer(recipe, Path(out_dir), Path(bundles) if bundles else PACKAGED)
    trainer.open(resume)
    with _bar(progress) as bar:
        task = bar.add_task(
            recipe.name, total=sum(p.updates for p in recipe.phase), completed=trainer.at.total
        )
        while not trainer.finished:
            trainer.advance()
            bar.update(task, completed=trainer.at.total, description=trainer.status)
    return TrainingResult(
        recipe, trainer.best_policy(), trainer.best_score, trainer.at.total, trainer.at.steps, trainer.folder
    )


def _bar(shown: bool) -> Bar:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Bar(*columns, console=Console(stderr=True), disable=not shown)
