"""What an experimenter asks of a loaded agent: facts, figures, and what its tokens mean."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.envs import registry
from models.policies.bundle import PolicyBundle
from server.domain.errors import NotFoundError
from server.services.lab import Lab

SHOWN_MAX = 36
FAINTEST = 0.02  # of the token's likeliest cell; fainter cells are left out of the picture
MEASURES = (
    ("success", "Success", "share"),
    ("steps", "Steps to find", "number"),
    ("found", "Found", "share"),
    ("arrived", "Arrived without collision", "share"),
    ("message_rate", "Messages sent", "share"),
    ("reward", "Reward", "number"),
    ("tokens_used", "Tokens in use", "count"),
)
SHAPE_OF_UNIT = {"share": "{:.1%}", "number": "{:.2f}", "count": "{:.0f}"}


@dataclass(frozen=True, slots=True)
class Figure:
    """A measured value as text; `range` is its 95 % interval, or empty."""

    name: str
    value: str
    range: str


@dataclass(frozen=True, slots=True)
class Condition:
    """What was measured under one condition of the evaluation."""

    name: str
    episodes: str
    figures: tuple[Figure, ...]


@dataclass(frozen=True, slots=True)
class TokenMeaning:
    """Where the speaker was when it said a token; `cells` as row, column, strength from 0 to 1."""

    token: int
    share: float
    entropy_bits: float
    null: bool
    cells: tuple[tuple[int, int, float], ...]


@dataclass(frozen=True, slots=True)
class AgentFacts:
    """One agent."""

    name: str
    environment: str
    channel: str
    gate: str
    budget: float
    tokens: int
    tokens_used: int
    tokens_null: int
    conditions: tuple[Condition, ...]
    sha256: str
    seed: int
    steps_trained: int
    warm_start: str
    git_commit: str
    created: str


def every(lab: Lab) -> tuple[AgentFacts, ...]:
    return tuple(facts(bundle) for _, bundle in sorted(lab.bundles.items()))


def find(lab: Lab, name: str) -> PolicyBundle:
    """The loaded agent of this name.

    Raises:
        NotFoundError: there is none.
    """
    if name not in lab.bundles:
        raise NotFoundError(f"no agent {name} is loaded")
    return lab.bundles[name]


def facts(bundle: PolicyBundle) -> AgentFacts:
    manifest, lexicon = bundle.manifest, bundle.lexicon
    return AgentFacts(
        name=bundle.name,
        environment=manifest.task,
        channel=manifest.channel,
        gate=manifest.gate,
        budget=float(manifest.budget),
        tokens=lexicon.tokens,
        tokens_used=int((lexicon.uses > 0).sum()),
        tokens_null=int((lexicon.null & (lexicon.uses > 0)).sum()),
        conditions=tuple(conditions(bundle.evaluation)),
        sha256=bundle.sha256,
        seed=manifest.seed,
        steps_trained=manifest.steps_trained,
        warm_start=manifest.warm_start or "nothing",
        git_commit=manifest.git_commit,
        created=manifest.created,
    )


def conditions(evaluation: Mapping[str, Any], name: str = "") -> Iterator[Condition]:
    """Every part of the evaluation that holds measures, however deep it stands."""
    if figures := tuple(measured(evaluation)):
        episodes = evaluation.get("episodes")
        yield Condition(name or "as released", f"{episodes:,}" if isinstance(episodes, int) else "", figures)
    for key, part in evaluation.items():
        if isinstance(part, Mapping) and "mean" not in part:
            yield from conditions(part, f"{name}, {key}" if name else str(key).replace("_", " "))


def measured(part: Mapping[str, Any]) -> Iterator[Figure]:
    for key, name, unit in MEASURES:
        value = part.get(key)
        if isinstance(value, Mapping) and isinstance(value.get("mean"), int | float):
            low_high = value.get("ci95") or ()
            yield Figure(name, text(value["mean"], unit), " to ".join(text(end, unit) for end in low_high))
        elif isinstance(value, int | float):
            yield Figure(name, text(value, unit), "")


def text(value: float, unit: str) -> str:
    return SHAPE_OF_UNIT[unit].format(value).replace("%", " %")


def meanings(bundle: PolicyBundle) -> tuple[tuple[int, int], tuple[TokenMeaning, ...]]:
    """Rows and columns of the world, and the most used tokens in the order of their numbers."""
    lexicon = bundle.lexicon
    rows, columns = registry.make(bundle.manifest.task).shape
    total = max(1, int(lexicon.uses.sum()))
    most = np.argsort(-lexicon.uses, kind="stable")[:SHOWN_MAX]
    said = sorted(int(token) for token in most if lexicon.uses[token] > 0)
    found = tuple(
        TokenMeaning(
            token,
            float(lexicon.uses[token]) / total,
            float(lexicon.entropy_bits[token]),
            bool(lexicon.null[token]),
            tuple(heat(lexicon.probability[token], columns)),
        )
        for token in said
    )
    return (rows, columns), found


def heat(probability: np.ndarray[Any, Any], columns: int) -> Iterator[tuple[int, int, float]]:
    strongest = max(float(probability.max()), 1e-12)
    for cell in np.flatnonzero(probability > FAINTEST * strongest):
        yield int(cell) // columns, int(cell) % columns, round(float(probability[cell]) / strongest, 2)
