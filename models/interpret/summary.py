"""Everything that is known about the language of one policy: lexicon, distances, calibration, as numbers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from models.bursts import Bursts, bursts
from models.envs.traffic_junction import TrafficJunction
from models.interpret.calibration import Calibration, calibrate
from models.interpret.correlation import Distances, Interval, distances
from models.interpret.estimate import EPISODES, lexicon, listen, vectors
from models.interpret.nulls import in_use, information, kinds, sensitivity
from models.interpret.shared import Shared, shared
from models.interpret.traffic import Traffic, traffic
from models.interpret.turns import for_people

if TYPE_CHECKING:
    from models.envs.api import Environment
    from models.interpret.along import Rate
    from models.policies.api import Policy
    from models.policies.lexicon import Lexicon

EPISODES_ELSEWHERE = 2_000
"""Of a task that does not say how many it needs."""
NO_TRAFFIC = "no traffic: rates along the route, lanes, gas and brake, and calibration are left out"
NO_TRIALS = "no room for human trials: counted in its own episodes, all seats; calibration is left out"


@dataclass(frozen=True, eq=False)
class Meaning:
    """A lexicon and what follows from it.

    Attributes:
        lexicon: what each token means.
        distances: pairs of tokens, near in meaning and near in the world?
        place: what a token tells about the cell of its speaker.
        bursts: message rates in stretches of five steps; None where messages are held, or nobody lived.
        traffic: what only traffic can tell; None elsewhere.
        calibration: whether the caution overlay can be believed; None where there are no human trials.
    """

    lexicon: Lexicon
    distances: Distances
    place: Shared
    bursts: Bursts | None = None
    traffic: Traffic | None = None
    calibration: dict[str, Calibration] | None = None


def interpret(env: Environment[Any], policy: Policy, seed: int, count: int | None = None) -> Meaning:
    """Estimate the lexicon from `count` episodes (the task's own number if None) and judge it."""
    episodes = EPISODES.get(env.name.split("/")[0], EPISODES_ELSEWHERE) if count is None else count
    turns, windows = listen(env, policy, episodes, seed)
    table = lexicon(env, policy, turns, seed)
    said = turns.take(turns.sent)
    far = distances(table, vectors(policy), env.shape, seed)
    place = shared(said.token, said.cell)
    burst = None if env.message_held else bursts(windows)
    if not isinstance(env, TrafficJunction):
        return Meaning(table, far, place, burst)
    found = traffic(env, turns, policy.tokens, seed)
    judged = calibrate(env, policy, table, seed, max(episodes // 4, 1)) if for_people(env) else None
    return Meaning(table, far, place, burst, found, judged)


def summary(meaning: Meaning) -> dict[str, Any]:
    """Return the numbers as JSON; what could not be computed is null."""
    numbers = _tokens(meaning.lexicon) | {
        "mutual_information_bits": meaning.place.bits,
        "mutual_information_plugin_bits": meaning.place.plugin_bits,
        "cell_entropy_bits": meaning.place.entropy_bits,
        **_distances(meaning.distances),
        "explained_variance": meaning.lexicon.explained.tolist(),
    }
    if meaning.bursts is not None:
        numbers["bursts"] = meaning.bursts.to_json()
    if meaning.traffic is not None:
        numbers["traffic"] = _traffic(meaning.traffic)
    if meaning.calibration is not None:
        numbers["calibration"] = {truth: _plain(judged) for truth, judged in meaning.calibration.items()}
    if meaning.calibration is None:
        numbers["left_out"] = NO_TRAFFIC if meaning.traffic is None else NO_TRIALS
    return numbers


def _tokens(table: Lexicon) -> dict[str, Any]:
    info = information(table)
    return {
        "messages": table.samples,
        "tokens": table.tokens,
        "tokens_said": int((table.uses > 0).sum()),
        "tokens_in_use": int(in_use(table.uses).sum()),
        "least_share_of_use": float(info.share.min()),
        "null_tokens": int(table.null.sum()),
        "null_messages": info.null_messages,
        "null_why": kinds(table)._asdict(),
        "null_sensitivity": [row._asdict() for row in sensitivity(table)],
        "token_entropy_bits": {str(i): float(table.entropy_bits[i]) for i in np.flatnonzero(~table.null)},
        "mean_entropy_bits": float(info.share @ table.entropy_bits),
    }


def _distances(found: Distances) -> dict[str, Any]:
    return {
        "distance_r2": _number(found.r2),
        "distance_r2_ci95": _pair(found.r2_ci95),
        "distance_slope_cells_per_unit": _number(found.slope),
        "distance_slope_ci95": _pair(found.slope_ci95),
        "distance_reason": found.reason,
        "pairs": len(found.pairs),
    }


def _traffic(found: Traffic) -> dict[str, Any]:
    way, done = found.along, found.deeds
    return {
        "rate": _rate(way.overall),
        "rate_entering": None if way.entering is None else _rate(way.entering),
        "rate_by_position": {str(place): _rate(rate) for place, rate in way.positions.items()},
        "gas": _number(done.gas_overall),
        "gas_by_token": {str(i): float(done.gas[i]) for i in np.flatnonzero(done.uses)},
        "information": {
            "lane": found.lane._asdict(),
            "arrival": found.arrival._asdict(),
            "route": found.route._asdict(),
            "action": done.token._asdict(),
            "action_from_cell": done.cell._asdict(),
            "action_beyond_cell_bits": done.beyond_cell_bits,
        },
        "shared_between_lanes": found.common_lanes._asdict(),
        "shared_between_arrivals": found.common_arrivals._asdict(),
    }


def _rate(rate: Rate) -> dict[str, Any]:
    return {"mean": rate.mean, "ci95": list(rate.ci95), "turns": rate.turns}


def _pair(interval: Interval | None) -> list[float] | None:
    return None if interval is None else list(interval)


def _plain(judged: Calibration) -> dict[str, Any]:
    return {**asdict(judged), "bins": [one._asdict() for one in judged.bins]}


def _number(value: float) -> float | None:
    return value if value == value else None  # noqa: PLR0124 (NaN is what differs from itself)
