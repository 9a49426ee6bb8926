"""What the folder of a training run holds: its recipe, its best policy, how far it got.

recipe.toml  provenance.json  checkpoint.safetensors  log.csv
"""

import hashlib
import json
import re
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor

from models.envs import registry
from models.policies.recurrent import Architecture, RecurrentPolicy
from models.training import checkpoint, config
from models.training.config import Recipe

RECIPE, PROVENANCE, LOG = "recipe.toml", "provenance.json", "log.csv"
ANCESTOR = "run:"
"""`init_from = "run:easy-fixed-proto"` is that recipe's run of the same seed, in the folder beside."""


class RunError(Exception):
    """A folder is not a run that can be used. One line: what is wrong and what to do."""


@dataclass(frozen=True, slots=True)
class Run:
    """A run as it stands."""

    folder: Path
    recipe: Recipe
    policy: RecurrentPolicy
    """The best of the phase at hand, with that phase's messages and gate."""
    finished: bool
    updates: int
    steps: int
    """Environment steps trained on."""


def read(folder: Path) -> Run:
    """Read a run.

    Raises:
        RunError: the folder is no run, or nothing was trained yet.
        RecipeError: its recipe is wrong.
        CheckpointError: its checkpoint is damaged.
    """
    if not (folder / RECIPE).exists():
        raise RunError(f"{folder}: not the folder of a run (no {RECIPE}); make one with hatlab train")
    if not (folder / checkpoint.FILE).exists():
        raise RunError(f"{folder}: nothing was trained yet; run hatlab train --resume")
    recipe, held = config.load(folder / RECIPE), checkpoint.read(folder)
    best, at = checkpoint.part_of(held.tensors, "best."), held.facts["at"]
    if not best:
        raise RunError(f"{folder}: no check in this phase yet; run hatlab train --resume")
    finished, phase = bool(held.facts["finished"]), recipe.phase[at["phase"]]
    try:
        net = RecurrentPolicy.from_weights(architecture(recipe), best).net
    except ValueError as error:
        raise RunError(f"{folder}: {error}; its checkpoint is of another recipe") from None
    policy = RecurrentPolicy(net, phase.discrete, phase.gate == "open")
    return Run(folder, recipe, policy, finished, int(at["total"]), int(at["steps"]))


def ancestor(folder: Path, init_from: str, seed: int) -> Run:
    """The finished run that a run in this folder starts from.

    Raises:
        RunError: it is missing or not finished.
        RecipeError: its recipe is wrong.
        CheckpointError: its checkpoint is damaged.
    """
    run = read(folder.absolute().parent / f"{init_from.removeprefix(ANCESTOR)}-{seed}")
    if not run.finished:
        raise RunError(f"{run.folder}: not finished; run hatlab train --resume")
    return run


def with_seed(recipe: str, seed: int) -> str:
    """The text of a recipe with another seed."""
    return re.sub(r"(?m)^seed\s*=.*$", f"seed = {seed}", recipe, count=1)


def architecture(recipe: Recipe) -> Architecture:
    """The sizes of the policy that a recipe trains."""
    env = registry.make(recipe.task)
    sizes = recipe.model.model_dump()
    return Architecture(observation_size=env.observation_size, actions=env.actions, **sizes)


def weights_sha256(weights: Mapping[str, Tensor]) -> str:
    """Name of these weights: sha256 over names and bytes."""
    digest = hashlib.sha256()
    for name in sorted(weights):
        digest.update(name.encode())
        digest.update(weights[name].detach().contiguous().numpy().tobytes())
    return digest.hexdigest()


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where weights come from; written when training starts."""

    git_commit: str

    @classmethod
    def here(cls) -> "Provenance":
        """The commit of this source tree; `unknown` outside a git checkout."""
        command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 (fixed words)
        except (OSError, subprocess.CalledProcessError):
            return cls("unknown")
        return cls(done.stdout.strip())

    @classmethod
    def read(cls, folder: Path) -> "Provenance":
        """Read what `write` left in a run's folder."""
        path = folder / PROVENANCE
        if not path.exists():
            return cls("unknown")
        return cls(**json.loads(path.read_text(encoding="utf-8")))

    def write(self, folder: Path) -> None:
        content = json.dumps({"git_commit": self.git_commit}) + "\n"
        (folder / PROVENANCE).write_text(content, encoding="utf-8")
