"""From a finished training run to a bundle: weights, lexicon, evaluation, card.

A bundle is what people will play with, so that its numbers are measured here, on its own weights, and never
copied from the training log.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from models import card, demands
from models.envs import registry
from models.envs.starts import has_room
from models.envs.traffic_junction import TrafficJunction
from models.evaluate import Question, evaluate
from models.interpret.summary import interpret, summary
from models.policies import bundle, scripted
from models.policies.bundle import Manifest, PolicyBundle
from models.policies.team import Team
from models.removal import removal
from models.training import checkpoint, held
from models.training.held import Provenance, Run, RunError

if TYPE_CHECKING:
    from pathlib import Path

    from models.envs.api import Environment
    from models.policies.api import Policy
    from models.policies.architectures import StoredPolicy

SEED = 7
EPISODES = 5_000
TOKENS_MAX = {"parent_child": 9}
"""People choose among these with the digit keys."""
BASELINES = {
    "traffic_junction": ("scripted:always-gas", "scripted:front-car-first"),
    "predator_prey": ("scripted:random", "scripted:straight"),
    "parent_child": ("scripted:seeker", "scripted:oracle"),
}


class ReleaseError(Exception):
    """The run cannot be released. One line: what is wrong and what to do."""


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
        ReleaseError: the run is missing, unfinished, or not fit for people; nothing is written then.
    """
    run = _finished(run_dir)
    manifest = _manifest(run, name or run.recipe.name, Provenance.read(run_dir))
    made = publish(run_dir, manifest, run.policy, root, episodes, lexicon_episodes)
    checkpoint.discard_resume(run_dir)
    return made


def publish(
    source: Path,
    manifest: Manifest,
    policy: StoredPolicy,
    root: Path,
    episodes: int = EPISODES,
    lexicon_episodes: int | None = None,
) -> PolicyBundle:
    """Measure a policy, estimate what its tokens mean, and write the bundle that the manifest describes.

    Raises:
        ReleaseError: it is not fit for people; nothing is written then. The line names `source`.
    """
    env = registry.make(manifest.task)
    _check_fit(env, policy)
    measured = evaluations(env, policy, episodes)
    _check_evaluation(source, manifest, measured["rows"])
    meaning = interpret(env, policy, SEED, lexicon_episodes)
    without = removal(env, policy, meaning.lexicon, episodes, SEED)
    said = {**summary(meaning), "null_removed": without}
    evaluation = {**measured, "meaning": said}
    text = card.text(manifest, evaluation)
    return bundle.save(root, manifest, policy.weights(), meaning.lexicon, evaluation, text)


def evaluations(env: Environment[Any], policy: Policy, episodes: int) -> dict[str, Any]:
    """Measure a policy in every way that its card reports."""
    family = env.name.split("/")[0]
    team = Team(env, policy)
    questions = {"as_trained": Question(episodes, SEED), "masked": Question(episodes, SEED, masked=True)}
    peopled = isinstance(env, TrafficJunction) and has_room(env)
    if peopled:
        questions["human"] = Question(episodes, SEED, "human")
        questions["human_masked"] = Question(episodes, SEED, "human", masked=True)
    rows = {row: _plain(evaluate(env, team, question)) for row, question in questions.items()}
    for baseline in BASELINES.get(family, ()):
        rule = scripted.make(baseline)
        rows[baseline] = _plain(evaluate(env, rule, Question(episodes, SEED)))
        if peopled:
            rows[f"{baseline} human"] = _plain(evaluate(env, rule, Question(episodes, SEED, "human")))
    return {"episodes": episodes, "seed": SEED, "rows": rows}


def _plain(measures: dict[str, Any]) -> dict[str, Any]:
    return {name: measure.to_json() for name, measure in measures.items()}


def _finished(run_dir: Path) -> Run:
    try:
        run = held.read(run_dir)
    except RunError as error:
        raise ReleaseError(str(error)) from None
    if not run.finished:
        raise ReleaseError(f"{run_dir}: training is not finished; run hatlab train --resume")
    return run


def _manifest(run: Run, name: str, provenance: Provenance) -> Manifest:
    recipe = run.recipe
    return manifest_of(
        run.policy,
        name=name,
        task=recipe.task,
        budget=recipe.budget,
        seed=recipe.seed,
        steps_trained=run.steps,
        warm_start=recipe.warm_start,
        recipe=recipe.model_dump(mode="json"),
        git_commit=provenance.git_commit,
    )


def manifest_of(policy: StoredPolicy, *, task: str, **origin: Any) -> Manifest:
    """Return the manifest of weights that are to be published now; `origin` is what they do not tell."""
    sizes: dict[str, Any] = policy.architecture.to_dict()
    channel, gate = sizes.pop("channel"), sizes.pop("gate")
    return Manifest(
        format=bundle.FORMAT,
        task=task,
        task_version=registry.make(task).version,
        channel=channel,
        gate=gate,
        sizes=sizes,
        created=datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        files={},
        **origin,
    )


def _check_evaluation(run_dir: Path, manifest: Manifest, rows: dict[str, Any]) -> None:
    facts = {"budget": manifest.budget, "tokens": manifest.sizes["tokens"]}
    if wrong := demands.complaints(manifest.task, rows, facts):
        raise ReleaseError(f"{run_dir}: fails its own evaluation: {'; '.join(wrong)}")


def _check_fit(env: Environment[Any], policy: Policy) -> None:
    if policy.tokens == 0:
        raise ReleaseError(
            f"a {policy.channel} channel has no tokens; only prototype and one-hot are released"
        )
    most = TOKENS_MAX.get(env.name)
    if most is not None and policy.tokens > most:
        raise ReleaseError(f"{policy.tokens} tokens, but {env.name} is played with at most {most}")
