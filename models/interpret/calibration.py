"""Can the caution overlay be believed? Likelihoods drawn on the road against cars that were there.

Each step of each held-out human trial gives one likelihood per road cell (the participant's own aside) and
two truths: a car that just spoke is there, and any car is there. Trials are resampled whole for intervals,
because the cells of one trial are not independent.

Source: DESIGN section 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from models.interpret.estimate import HELD_OUT, hearable, lives
from models.policies.lexicon import Lexicon, occupancy
from models.rollout import Rollout, trials

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.envs.traffic_junction import TrafficJunction
    from models.policies.api import Policy

DRAWN_MIN = 0.05
"""Triangles stand where the likelihood is at least this (DESIGN section 5)."""
BINS = 10
RESAMPLES = 1_000
EPISODES = 500


class Bin(NamedTuple):
    """Drawn cells of about equal number, by likelihood."""

    said: float
    """Mean likelihood."""
    seen: float
    """Share of cells that held a car."""
    cells: int


@dataclass(frozen=True)
class Calibration:
    """How far the overlay is right, about one kind of truth.

    Attributes:
        bins: ten equal-count bins of the drawn cells.
        ece: expected calibration error, the mean gap |said - seen| over bins weighted by cells.
        ece_ci95: bootstrap interval over trials.
        brier: mean squared difference of likelihood and truth (0 or 1) over road cells, the own one left out.
        brier_base: the same of a forecaster who knows each cell's base rate.
        brier_skill: 1 - Brier / Brier of a forecaster who knows each cell's base rate.
        brier_skill_ci95: bootstrap interval over trials.
        coverage: share of cars (others, or others that just spoke) on a cell with a triangle.
        coverage_ci95: bootstrap interval over trials.
        drawn: number of cells drawn.
        trials: number of trials.
    """

    bins: tuple[Bin, ...]
    ece: float
    ece_ci95: tuple[float, float]
    brier: float
    brier_base: float
    brier_skill: float
    brier_skill_ci95: tuple[float, float]
    coverage: float
    coverage_ci95: tuple[float, float]
    drawn: int
    trials: int


@dataclass(frozen=True, eq=False)
class Overlay:
    """Every step that a participant would decide in, S of them, on R road cells.

    Attributes:
        trial: (S,) which trial the step belongs to.
        likelihood: (S, R) what the overlay claims; 0 in the own cell.
        own: (S, R) the participant's own cell.
        spoke: (S, R) cars there that just spoke, the participant's aside.
        there: (S, R) cars there at all, the participant's aside.
    """

    trial: NDArray[np.int64]
    likelihood: NDArray[np.float64]
    own: NDArray[np.bool_]
    spoke: NDArray[np.int64]
    there: NDArray[np.int64]


def calibrate(
    env: TrafficJunction, policy: Policy, lexicon: Lexicon, seed: int, count: int = EPISODES
) -> dict[str, Calibration]:
    """Judge a lexicon on held-out human-trial starts: {"spoke": ..., "all_cars": ...}."""
    overlay = observe(env, policy, lexicon, seed, count)
    return {
        "spoke": judge(overlay, overlay.spoke, count, seed),
        "all_cars": judge(overlay, overlay.there, count, seed),
    }


def observe(env: TrafficJunction, policy: Policy, lexicon: Lexicon, seed: int, count: int) -> Overlay:
    """Play held-out trials and note claim and truth at every step."""
    parts, first = [], 0
    for rollout in lives(env, policy, count, seed, HELD_OUT):
        parts.append(_overlay(env, lexicon, rollout, first))
        first += rollout.cells.shape[1]
    columns = zip(*[(p.trial, p.likelihood, p.own, p.spoke, p.there) for p in parts], strict=True)
    return Overlay(*(np.concatenate(column) for column in columns))


def _overlay(env: TrafficJunction, lexicon: Lexicon, rollout: Rollout, first: int) -> Overlay:
    heard = hearable(env, rollout)
    step, trial = np.nonzero(np.arange(len(heard))[:, None] < trials(rollout).steps)  # (S,)
    own = rollout.cells[step, trial, -1]
    claim = np.stack(
        [occupancy(lexicon, rollout.tokens[t, b], heard[t, b]) for t, b in zip(step, trial, strict=True)]
    )  # (S, C)
    at = np.arange(len(step))
    claim[at, own] = 0.0
    mine = np.zeros(claim.shape, np.bool_)
    mine[at, own] = True
    cells, others = rollout.cells[step, trial, :-1], rollout.alive[step, trial, :-1]
    road = env.roads.road_cells
    return Overlay(
        trial=trial + first,
        likelihood=claim[:, road],
        own=mine[:, road],
        spoke=_count(cells, heard[step, trial, :-1], env.cells)[:, road],
        there=_count(cells, others, env.cells)[:, road],
    )


def _count(cells: NDArray[np.int32], kept: NDArray[np.bool_], total: int) -> NDArray[np.int64]:
    """Cars per cell: (S, C) from cells (S, M)."""
    count = np.zeros((len(cells), total), np.int64)
    row, seat = np.nonzero(kept)
    np.add.at(count, (row, cells[row, seat]), 1)
    return count


def judge(overlay: Overlay, cars: NDArray[np.int64], count: int, seed: int) -> Calibration:
    """Compare claims with where `cars` (S, R) were, over `count` trials."""
    drawn = overlay.likelihood >= DRAWN_MIN
    table, bins = _bins(overlay, drawn, cars > 0, count)
    skill = _skill(overlay, cars > 0, count)
    cover = np.stack([_per_trial(overlay, cars * drawn, count), _per_trial(overlay, cars, count)], axis=1)
    draws = np.random.default_rng(seed).multinomial(
        count, np.full(count, 1 / count), RESAMPLES
    )  # (R, trials)
    return Calibration(
        bins=bins,
        ece=float(_ece(table.sum(axis=0))),
        ece_ci95=_interval(_ece(np.tensordot(draws, table, axes=1))),
        brier=float(skill[:, 0].sum() / max(skill[:, 2].sum(), 1)),
        brier_base=float(skill[:, 1].sum() / max(skill[:, 2].sum(), 1)),
        brier_skill=float(_ratio_skill(skill.sum(axis=0))),
        brier_skill_ci95=_interval(_ratio_skill(draws @ skill)),
        coverage=float(_share(cover.sum(axis=0))),
        coverage_ci95=_interval(_share(draws @ cover)),
        drawn=int(drawn.sum()),
        trials=count,
    )


def _bins(
    overlay: Overlay, drawn: NDArray[np.bool_], truth: NDArray[np.bool_], count: int
) -> tuple[NDArray[np.float64], tuple[Bin, ...]]:
    """Sums per trial and bin, (trials, BINS, 3: cells, said, seen), and the bins themselves."""
    step, cell = np.nonzero(drawn)
    said, seen = overlay.likelihood[step, cell], truth[step, cell]
    order = np.argsort(said, kind="stable")
    table = np.zeros((count, BINS, 3))
    for index, part in enumerate(np.array_split(order, BINS)):
        values = np.stack([np.ones(len(part)), said[part], seen[part]], axis=1)
        np.add.at(table[:, index], overlay.trial[step[part]], values)
    totals = table.sum(axis=0)
    kept = totals[totals[:, 0] > 0]
    return table, tuple(Bin(float(p / n), float(o / n), int(n)) for n, p, o in kept)


def _ece(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Σ over bins of |Σ said - Σ seen| / cells, from (…, BINS, 3)."""
    gaps = np.abs(table[..., 1] - table[..., 2]).sum(axis=-1)
    return np.asarray(gaps / np.maximum(table[..., 0].sum(axis=-1), 1))


def _skill(overlay: Overlay, truth: NDArray[np.bool_], count: int) -> NDArray[np.float64]:
    """Squared errors per trial, (trials, 3: overlay, base rate, cells asked), the own cell left out."""
    asked = ~overlay.own
    rate = (truth & asked).sum(axis=0) / np.maximum(asked.sum(axis=0), 1)  # (R,)
    mine = (overlay.likelihood - truth) ** 2 * asked
    base = (rate - truth) ** 2 * asked
    return np.stack([_per_trial(overlay, values, count) for values in (mine, base, asked)], axis=1)


def _per_trial(overlay: Overlay, values: NDArray[Any], count: int) -> NDArray[np.float64]:
    weights = values.sum(axis=1).astype(np.float64)
    return np.bincount(overlay.trial, weights=weights, minlength=count).astype(np.float64)


def _ratio_skill(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(1 - sums[..., 0] / np.maximum(sums[..., 1], 1e-12))


def _share(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(sums[..., 0] / np.maximum(sums[..., 1], 1))


def _interval(values: NDArray[np.float64]) -> tuple[float, float]:
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)
