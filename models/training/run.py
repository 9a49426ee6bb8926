"""Follow a recipe from the first update to the best policy."""

import time
from dataclasses import dataclass
from pathlib import Path

import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from models.policies.recurrent import RecurrentPolicy
from models.training import config, curve, log
from models.training.allocation import keep_freed_memory
from models.training.config import Recipe
from models.training.device import find
from models.training.trainer import Trainer

PACKAGED = Path(__file__).parent.parent / "bundles"
CURVE_EVERY_S = 300.0
"""Least time between two drawings of the curve: each takes half a second, which a run should not feel."""
READINGS = (
    {"success": "success", "rate": "message_rate", "drawn": "drawn_rate"},
    {"entropy": "entropy", "decoder": "decoder"},
)
"""Lines of label and reading; *rate* is of greedy gates, *drawn* of those of training."""


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
    seconds: float
    """Wall time, over all resumptions."""
    cpu_s: float
    """Processor time, over all resumptions, checks included."""
    folder: Path
    log: Path
    """A line per check; see ``models.training.log``."""


def run(
    recipe_path: Path | str,
    out_dir: Path | str,
    resume: bool = False,
    progress: bool = True,
    bundles: Path | str | None = None,
    checkpoint_every: int | None = None,
    device: str = "cpu",
) -> TrainingResult:
    """Train what a recipe describes.

    Args:
        recipe_path: TOML file.
        out_dir: folder of the run.
        resume: go on from the folder's checkpoint, or from a packed one, if there is one.
        progress: draw a progress bar on standard error.
        bundles: where ``init_from`` is looked up; the packaged bundles if absent.
        checkpoint_every: updates between checkpoints, beside those at every check.
        device: where the network is, and what it computes.

    Raises:
        RecipeError: the recipe is wrong.
        DeviceError: there is no such device.
        TrainingError: the folder holds another run, or the start is missing.
        StoppedError: the loss is not finite, or the disk is full; the last good checkpoint is whole.
        CheckpointError: the checkpoint is damaged.
    """
    recipe = config.load(recipe_path)
    torch.set_num_threads(1)
    keep_freed_memory()
    root = Path(bundles) if bundles else PACKAGED
    trainer = Trainer(recipe, Path(out_dir), root, checkpoint_every, find(device))
    trainer.open(resume)
    _follow(trainer, progress)
    return TrainingResult(
        recipe,
        trainer.best_policy(),
        trainer.best_score,
        trainer.at.total,
        trainer.at.steps,
        trainer.clock.seconds,
        trainer.clock.cpu_s,
        trainer.folder,
        trainer.folder / log.FILE,
    )


def _follow(trainer: Trainer, progress: bool) -> None:
    """Advance to the end, showing how it goes; the curve is drawn now and then, and whatever happens."""
    drawn = time.monotonic()
    with _bar(progress) as bar:
        updates = sum(phase.updates for phase in trainer.recipe.phase)
        task = bar.add_task(_status(trainer), total=updates, completed=trainer.at.total)
        try:
            while not trainer.finished:
                trainer.advance()
                bar.update(task, description=_status(trainer), completed=trainer.at.total)
                if trainer.just_checked and time.monotonic() - drawn > CURVE_EVERY_S:
                    curve.draw(trainer.folder, trainer.recipe)
                    drawn = time.monotonic()
        finally:
            curve.draw(trainer.folder, trainer.recipe)


def _bar(shown: bool) -> Bar:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(10),  # three lines of text, bar, count and time fit into 80 columns
        MofNCompleteColumn(),
        TimeRemainingColumn(compact=True),
    )
    return Bar(*columns, console=Console(stderr=True), disable=not shown)


def _status(trainer: Trainer) -> str:
    """Where the run is, and under it what it has reached."""
    phase = "done" if trainer.finished else trainer.phase.name
    return "\n".join([f"{trainer.recipe.name}: {phase}", *(_shown(trainer, labels) for labels in READINGS)])


def _shown(trainer: Trainer, labels: dict[str, str]) -> str:
    values = {label: getattr(trainer.readings, name) for label, name in labels.items()}
    return "  ".join(
        f"{label} {'–' if value is None else format(value, '.3f')}" for label, value in values.items()
    )
