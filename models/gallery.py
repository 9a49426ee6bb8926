"""The paper's figures of meaning, drawn again from the released agents, and a page with their numbers.

`hatlab figures --out docs/figures` writes all of it; nothing on the page is typed.

Source: Karten et al. 2023, figures 4 to 8.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from models.card import meaning_lines
from models.envs import registry
from models.envs.traffic_junction import TrafficJunction
from models.interpret import figures
from models.interpret.summary import Meaning, interpret, summary
from models.removal import EPISODES, removal

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from models.envs.api import Environment
    from models.policies.bundle import PolicyBundle

PROTOTYPE, ONE_HOT = "parent_child/prototype-9", "parent_child/onehot-9"
DRIVERS = {
    "b = 1": "traffic_junction/budget-100",
    "b = .5": "traffic_junction/budget-050",
    "b = .3": "traffic_junction/budget-030",
}
AGENTS = (PROTOTYPE, ONE_HOT, *DRIVERS.values())
PAPER_R2 = {PROTOTYPE: "about .5", ONE_HOT: "0"}
PAPER_SLOPES = {DRIVERS["b = 1"]: 1.94, DRIVERS["b = .5"]: 1.09, DRIVERS["b = .3"]: 2.36}
"""Source: the paper's section on interpretability."""

HEAD = """# Figures of meaning

This page and its pictures are written by `hatlab figures --out docs/figures` (`make figures`), from the
released agents, seed {seed}{count}. They redraw the subjects of figures 4 to 8 of Karten et al. 2023 from our
agents; files are named by what they show. What each number means, and how it is counted:
[Interpret](../agents.md#interpret).
"""


class Picture(NamedTuple):
    """One figure of the page."""

    name: str
    title: str
    shows: str
    chart: Any
    agents: tuple[str, ...]


class Said(NamedTuple):
    """A released agent and what its language was found to mean."""

    env: Environment[Any]
    meaning: Meaning
    numbers: dict[str, Any]
    sha256: str


def draw(
    held: Mapping[str, PolicyBundle], out: Path, seed: int, count: int | None = None, *, png: bool = False
) -> list[Path]:
    """Write every figure and README.md; `held` are the bundles named in `AGENTS`."""
    said = {name: _listen(held[name], seed, count) for name in AGENTS}
    pictures = [*_searches(said), *_crossings(said)]
    written = figures.write({picture.name: picture.chart for picture in pictures}, out, png=png)
    page = out / "README.md"
    page.write_text(_page(pictures, said, seed, count), encoding="utf-8")
    return [*written, page]


def _listen(bundle: PolicyBundle, seed: int, count: int | None) -> Said:
    env = registry.make(bundle.manifest.task)
    meaning = interpret(env, bundle.policy, seed, count)
    numbers = summary(meaning)
    numbers["null_removed"] = removal(env, bundle.policy, meaning.lexicon, count or EPISODES, seed)
    return Said(env, meaning, numbers, bundle.sha256)


def _searches(said: Mapping[str, Said]) -> Iterator[Picture]:
    child = said[PROTOTYPE]
    yield Picture(
        "child-tokens",
        "Parent & Lost Child: tokens on their plane",
        "The nine prototypes on their first two principal components, one scale for both axes.",
        figures.prototypes(child.meaning.lexicon),
        (PROTOTYPE,),
    )
    yield Picture(
        "child-places",
        "Parent & Lost Child: where the child was",
        "One 9x9 grid per prototype: P(cell of the child | token).",
        figures.heatmaps(child.meaning.lexicon, figures.ground(child.env)),
        (PROTOTYPE,),
    )
    yield Picture(
        "child-distances",
        "Parent & Lost Child: distance of prototypes and of places",
        "A point per pair of tokens. Intervals: tokens resampled, not pairs. One-hot vectors are all √2 "
        "apart, so that their r² is undefined and 0 by definition.",
        figures.beside(
            _distances(said[PROTOTYPE], PROTOTYPE, f"paper: r² {PAPER_R2[PROTOTYPE]}"),
            _distances(said[ONE_HOT], ONE_HOT, f"paper: r² {PAPER_R2[ONE_HOT]}"),
        ),
        (PROTOTYPE, ONE_HOT),
    )


def _crossings(said: Mapping[str, Said]) -> Iterator[Picture]:
    full = said[DRIVERS["b = 1"]]
    assert isinstance(full.env, TrafficJunction)
    assert full.meaning.traffic is not None
    lexicon = full.meaning.lexicon
    yield Picture(
        "traffic-places",
        "Traffic Junction: where the speakers were",
        "The most used tokens of b = 1 on the roads: P(cell of the speaker | token).",
        figures.heatmaps(lexicon, figures.ground(full.env)),
        (DRIVERS["b = 1"],),
    )
    yield Picture(
        "traffic-lanes-and-actions",
        "Traffic Junction: lanes, gas and brake",
        "The tokens of b = 1 on their plane: left by the direction of the lane that most of their messages "
        "come from, right by what their speakers do in the same step.",
        figures.beside(
            figures.by_lane(lexicon, full.meaning.traffic),
            figures.by_gas(lexicon, full.meaning.traffic.deeds),
        ),
        (DRIVERS["b = 1"],),
    )
    yield Picture(
        "traffic-distances",
        "Traffic Junction: distance of prototypes and of places",
        "Pairs of tokens, counted in boxes, for the three budgets. Slopes are in cells per unit of each "
        "agent's own message space, so that only their sign and r² compare across agents and with the paper.",
        figures.beside(
            *(
                _distances(said[name], f"Message budget {budget}", f"paper: slope {PAPER_SLOPES[name]:.2f}")
                for budget, name in DRIVERS.items()
            )
        ),
        tuple(DRIVERS.values()),
    )
    ways = {budget: said[name].meaning.traffic for budget, name in DRIVERS.items()}
    yield Picture(
        "traffic-rate-along-route",
        "Traffic Junction: when agents speak on their way",
        "Messages per step of a car by the cells that it has driven since its entrance, in human trials; "
        "bands: 95 %, trials resampled.",
        figures.rate_along_route(
            full.env, {budget: way.along for budget, way in ways.items() if way is not None}
        ),
        tuple(DRIVERS.values()),
    )


def _distances(said: Said, heading: str, note: str) -> Any:
    return figures.distance_scatter(said.meaning.distances, heading, note)


def _page(pictures: list[Picture], said: Mapping[str, Said], seed: int, count: int | None) -> str:
    counted = "" if count is None else f", {count:,} episodes"
    parts = [HEAD.format(seed=seed, count=counted)]
    for picture in pictures:
        agents = ", ".join(f"`{name}`" for name in picture.agents)
        image = f"![{picture.title}]({picture.name}.svg)"
        parts.append(f"## {picture.title}\n\n{image}\n\n{picture.shows} From {agents}.\n")
    parts.append(
        "## Numbers\n\nPrinted by `hatlab figures`, as `hatlab interpret` prints them for one agent.\n"
    )
    parts += [_numbers(name, each) for name, each in said.items()]
    return "\n".join(parts)


def _numbers(name: str, said: Said) -> str:
    numbers = said.numbers
    uses = f"{numbers['tokens_in_use']} of {numbers['tokens']} tokens in use"
    lines = [f"bundle: sha256 `{said.sha256}`", f"{numbers['messages']:,} messages, {uses}"]
    lines += meaning_lines(numbers)
    return f"### {name}\n\n" + "\n".join(f"- {line}" for line in lines) + "\n"
