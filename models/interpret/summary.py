"""Everything that is known about the language of one policy: lexicon, distances, calibration, as numbers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from models.envs.traffic_junction import TrafficJunction
from models.interpret.calibration import Calibration, calibrate
from models.interpret.correlation import Distances, distances
from models.interpret.estimate import EPISODES, estimate, vectors
from models.interpret.nulls import in_use, information

if TYPE_CHECKING:
    from models.envs.api import Environment
    from models.policies.api import Policy
    from models.policies.lexicon import Lexicon


@dataclass(frozen=True, eq=False)
class Meaning:
    """A lexicon and what follows from it.

    Attributes:
        lexicon: what each token means.
        distances: pairs of tokens, near in meaning and near in the world?
        calibration: whether the caution overlay can be believed; None outside Traffic Junction.
    """

    lexicon: Lexicon
    distances: Distances
    calibration: dict[str, Calibration] | None


def interpret(env: Environment[Any], policy: Policy, seed: int, count: int | None = None) -> Meaning:
    """Estimate the lexicon from `count` episodes (the task's own number if None) and judge it."""
    episodes = EPISODES[env.name.split("/")[0]] if count is None else count
    lexicon = estimate(env, policy, episodes, seed)
    judged = None
    if isinstance(env, TrafficJunction):
        judged = calibrate(env, policy, lexicon, seed, max(episodes // 4, 1))
    return Meaning(lexicon, distances(lexicon, vectors(policy), env.shape), judged)


def summary(meaning: Meaning) -> dict[str, Any]:
    """Return the numbers as JSON; what could not be computed is null."""
    lexicon, found = meaning.lexicon, meaning.distances
    info = information(lexicon)
    numbers: dict[str, Any] = {
        "messages": lexicon.samples,
        "tokens": lexicon.tokens,
        "tokens_said": int((lexicon.uses > 0).sum()),
        "tokens_in_use": int(in_use(lexicon.uses).sum()),
        "least_share_of_use": float(info.share.min()),
        "null_tokens": int(lexicon.null.sum()),
        "null_messages": info.null_messages,
        "mutual_information_bits": info.mutual_bits,
        "cell_entropy_bits": info.prior_bits,
        "distance_r2": _number(found.r2),
        "distance_slope_cells_per_unit": _number(found.slope),
        "pairs": len(found.pairs),
        "explained_variance": lexicon.explained.tolist(),
    }
    if meaning.calibration is not None:
        numbers["calibration"] = {truth: _plain(judged) for truth, judged in meaning.calibration.items()}
    return numbers


def _plain(judged: Calibration) -> dict[str, Any]:
    return {**asdict(judged), "bins": [one._asdict() for one in judged.bins]}


def _number(value: float) -> float | None:
    return value if value == value else None  # noqa: PLR0124 (NaN is what differs from itself)
