"""What an experimenter asks of a loaded agent: facts, figures, and what its tokens mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from models.envs import registry
from server.domain.errors import NotFoundError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from models.policies.bundle import PolicyBundle
    from server.services.lab import Lab

SHOWN_MAX = 36
FAINTEST = 0.02  # of the token's likeliest cell; fainter cells are left out of the picture
MEASURES = (
    ("success", "Success", "share"),
    ("steps", "Steps to find", "number"),
    ("arrived", "Arrived", "share"),
    ("message_rate", "Messages sent", "share"),
    ("reward", "Reward", "number"),
)
CONDITIONS = {
    "as_trained": "As trained",
    "masked": "Messages masked",
    "human": "In participants’ trials",
    "human_masked": "In participants’ trials, messages masked",
}
MEANINGS = (
    ("null_messages", "Messages that say nothing", "share"),
    ("distance_r2", "Token distance and place, r²", "number"),
    ("mutual_information_bits", "Information on the place, bit", "number"),
)
CALIBRATION = (
    ("ece", "Calibration error", "small"),
    ("brier_skill", "Brier skill", "number"),
    ("coverage", "Cars under a triangle", "share"),
)
FORMATS = {"share": "{:.1%}", "number": "{:.2f}", "small": "{:.4f}"}


@dataclass(frozen=True, slots=True)
class Figure:
    """A measured value as text; `range` is its 95 % interval, or empty."""

    name: str
    value: str
    range: str = ""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What was measured before release: a table of conditions by measures, and what messages mean.

    `calibration` holds, for each bin, the likelihood that the overlay said and the share that was seen.
    """

    episodes: str
    measures: tuple[str, ...]
    conditions: tuple[tuple[str, tuple[Figure, ...]], ...]
    meaning: tuple[Figure, ...]
    calibration: tuple[tuple[float, float], ...]


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
    headline: tuple[Figure, ...]
    evaluation: Evaluation
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
    manifest, lexicon, found = bundle.manifest, bundle.lexicon, bundle.evaluation
    meaning = part(found, "meaning")
    return AgentFacts(
        name=bundle.name,
        environment=manifest.task,
        channel=manifest.channel,
        gate=manifest.gate,
        budget=float(manifest.budget),
        tokens=lexicon.tokens,
        tokens_used=int(meaning.get("tokens_in_use", (lexicon.uses > 0).sum())),
        tokens_null=int((lexicon.null & (lexicon.uses > 0)).sum()),
        headline=headline(part(found, "rows")),
        evaluation=evaluation(found),
        sha256=bundle.sha256,
        seed=manifest.seed,
        steps_trained=manifest.steps_trained,
        warm_start=manifest.warm_start or "nothing",
        git_commit=manifest.git_commit,
        created=manifest.created,
    )


def part(tree: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """A part of the evaluation; a bundle may lack any."""
    found = tree.get(key)
    return found if isinstance(found, Mapping) else {}


def headline(rows: Mapping[str, Any]) -> tuple[Figure, ...]:
    """The figures that tell most: in the world it was trained for, and in the trials that people get."""
    trained, human = part(rows, "as_trained"), part(rows, "human")
    chosen = (
        figure(trained, "success", "Success", "share"),
        figure(trained, "steps", "Steps to find", "number"),
        figure(human, "arrived", "Arrived in participants’ trials", "share"),
    )
    return tuple(each for each in chosen if each.value)


def evaluation(found: Mapping[str, Any]) -> Evaluation:
    rows, meaning = part(found, "rows"), part(found, "meaning")
    measures = [each for each in MEASURES if any(each[0] in part(rows, row) for row in rows)]
    spoke = part(part(meaning, "calibration"), "spoke")
    said = [figure(meaning, *each) for each in MEANINGS] + [figure(spoke, *each) for each in CALIBRATION]
    episodes = found.get("episodes")
    return Evaluation(
        episodes=f"{episodes:,}" if isinstance(episodes, int) and rows else "",
        measures=tuple(name for _, name, _ in measures),
        conditions=tuple(
            (condition(row), tuple(figure(part(rows, row), *each) for each in measures))
            for row in sorted(rows, key=lambda row: (*CONDITIONS, row).index(row))
        ),
        meaning=tuple(each for each in said if each.value),
        calibration=tuple((float(each["said"]), float(each["seen"])) for each in spoke.get("bins", ())),
    )


def condition(row: str) -> str:
    if row.startswith("scripted:"):
        name, _, start = row.removeprefix("scripted:").partition(" ")
        return f"Scripted {name.replace('-', ' ')}{', in participants’ trials' if start else ''}"
    return CONDITIONS.get(row, row.replace("_", " "))


def figure(row: Mapping[str, Any], key: str, name: str, unit: str) -> Figure:
    """A measure as text; without a value where the row has none."""
    value = row.get(key)
    measure = value if isinstance(value, Mapping) else {"mean": value, "ci95": row.get(f"{key}_ci95")}
    mean, low_high = measure.get("mean"), measure.get("ci95") or ()
    if not isinstance(mean, int | float):
        return Figure(name, "")
    return Figure(name, text(mean, unit), " to ".join(text(end, unit) for end in low_high))


def text(value: float, unit: str) -> str:
    return FORMATS[unit].format(value).replace("%", "\u00a0%")


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
