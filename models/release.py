"""From a finished training run to a bundle: weights, lexicon, evaluation, card.

A bundle is what people will play with, so that its numbers are measured here, on its own weights, and never
copied from the training log.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from models import card
from models.envs import registry
from models.evaluate import Question, evaluate
from models.interpret.summary import interpret, summary
from models.policies import bundle, scripted
from models.policies.bundle import Manifest, PolicyBundle
from models.policies.recurrent import Architecture, RecurrentPolicy
from models.policies.team import Team
from models.training import checkpoint, config

if TYPE_CHECKING:
    from models.envs.api import Environment
    from models.policies.api import Policy
    from models.training import Recipe

RECIPE, PROVENANCE = "recipe.toml", "provenance.json"
SEED = 7
EPISODES = 5_000
TOKENS_MAX = {"parent_child": 9}
"""People choose among these with the digit keys."""
BASELINES = {
    "traffic_junction": ("scripted:always-gas", "scripted:front-car-first"),
    "parent_child": ("scripted:seeker", "scripted:oracle"),
}


class ReleaseError(Exception):
    """The run cannot be released. One line: what is wrong and what to do."""


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where weights come from; written when training starts."""

    git_commit: str

    @classmethod
    def here(cls) -> Provenance:
        """The commit of this source tree; `unknown` outside a git checkout."""
        command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 (fixed words)
        except (OSError, subprocess.CalledProcessError):
            return cls("unknown")
        return cls(done.stdout.strip())

    @classmethod
    def read(cls, folder: Path) -> Provenance:
        """Read what `write` left in a run's folder."""
        path = folder / PROVENANCE
        if not path.exists():
            return cls("unknown")
        return cls(**json.loads(path.read_text(encoding="utf-8")))

    def write(self, folder: Path) -> None:
        content = json.dumps({"git_commit": self.git_commit}) + "\n"
        (folder / PROVENANCE).write_text(content, encoding="utf-8")


def release(
    run_dir: Path, name: str | None, root: Path, episodes: int = EPISODES, lexicon_episodes: int | None = None
) -> PolicyBundle:
    """Write `<root>/<name>` from a finished run and load it again.

    Args:
        run_dir: folder of `hatlab train`.
        name: bundle name; the recipe's own if None.
        root: folder of bundles.
        episodes: of each evaluation.
        lexicon_episodes: of the lexicon; the task's own number if None.

    Raises:
        ReleaseError: the run is missing, unfinished, or not fit for people.
    """
    run = _finished(run_dir)
    env, policy = registry.make(run.recipe.task), run.policy
    manifest = _manifest(run, name or run.recipe.name, Provenance.read(run_dir))
    _check_fit(env, policy)
    meaning = interpret(env, policy, SEED, lexicon_episodes)
    evaluation = {**evaluations(env, policy, episodes), "meaning": summary(meaning)}
    text = card.text(manifest, evaluation)
    return bundle.save(root, manifest, policy.weights(), meaning.lexicon, evaluation, text)


def evaluations(env: Environment[Any], policy: Policy, episodes: int) -> dict[str, Any]:
    """Measure a policy in every way that its card reports."""
    family = env.name.split("/")[0]
    team = Team(env, policy)
    questions = {"as_trained": Question(episodes, SEED), "masked": Question(episodes, SEED, masked=True)}
    if family == "traffic_junction":
        questions["human"] = Question(episodes, SEED, "human")
        questions["human_masked"] = Question(episodes, SEED, "human", masked=True)
    rows = {row: _plain(evaluate(env, team, question)) for row, question in questions.items()}
    for baseline in BASELINES[family]:
        rule = scripted.make(baseline)
        rows[baseline] = _plain(evaluate(env, rule, Question(episodes, SEED)))
        if family == "traffic_junction":
            rows[f"{baseline} human"] = _plain(evaluate(env, rule, Question(episodes, SEED, "human")))
    return {"episodes": episodes, "seed": SEED, "rows": rows}


def _plain(measures: dict[str, Any]) -> dict[str, Any]:
    return {name: measure.to_json() for name, measure in measures.items()}


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """What training left: the recipe, its best policy, environment steps."""

    recipe: Recipe
    policy: RecurrentPolicy
    steps: int


def _finished(run_dir: Path) -> FinishedRun:
    if not (run_dir / RECIPE).exists():
        raise ReleaseError(f"{run_dir}: not the folder of a run (no {RECIPE}); make one with hatlab train")
    if not (run_dir / checkpoint.FILE).exists():
        raise ReleaseError(f"{run_dir}: nothing was trained yet; run hatlab train --resume")
    recipe, held = config.load(run_dir / RECIPE), checkpoint.read(run_dir)
    if not held.facts["finished"]:
        raise ReleaseError(f"{run_dir}: training is not finished; run hatlab train --resume")
    env, sizes = registry.make(recipe.task), recipe.model.model_dump()
    architecture = Architecture(observation_size=env.observation_size, actions=env.actions, **sizes)
    try:
        policy = RecurrentPolicy.from_weights(architecture, checkpoint.part_of(held.tensors, "best."))
    except ValueError as error:
        raise ReleaseError(f"{run_dir}: {error}; its checkpoint is of another recipe") from None
    return FinishedRun(recipe, policy, int(held.facts["at"]["steps"]))


def _manifest(run: FinishedRun, name: str, provenance: Provenance) -> Manifest:
    recipe = run.recipe
    sizes = run.policy.architecture.to_dict()
    channel, gate = sizes.pop("channel"), sizes.pop("gate")
    return Manifest(
        format=bundle.FORMAT,
        name=name,
        task=recipe.task,
        task_version=registry.make(recipe.task).version,
        channel=channel,
        gate=gate,
        budget=recipe.budget,
        sizes=sizes,
        seed=recipe.seed,
        steps_trained=run.steps,
        warm_start=recipe.warm_start,
        recipe=recipe.model_dump(mode="json"),
        git_commit=provenance.git_commit,
        created=datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        files={},
    )


def _check_fit(env: Environment[Any], policy: Policy) -> None:
    if policy.tokens == 0:
        raise ReleaseError(
            f"a {policy.channel} channel has no tokens; only prototype and one-hot are released"
        )
    most = TOKENS_MAX.get(env.name)
    if most is not None and policy.tokens > most:
        raise ReleaseError(f"{policy.tokens} tokens, but {env.name} is played with at most {most}")
