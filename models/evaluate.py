"""How well do players do? Many episodes, every number with its 95 % interval, the same for the same seed.

What each number means:

- success: share of episodes that the world calls a success.
- reward: summed over an episode, mean over seats (Predator-Prey: the predators' mean, which the prey gets).
- message_rate: messages sent per step of a living agent that may speak; message_rate_slots: per step of a
  seat that may speak, empty ones too (what the public IC3Net code counts).
- tokens_used: tokens in use (`models.interpret.nulls.in_use`: from 1 % of the messages on, for nine tokens;
  a message that is held for the whole episode counts once).
- Parent & Lost Child: found, and steps (20 if not found).
- human starts, judged for the seat where a participant would sit: arrived, collided, limit (shares of
  trials), trial_steps, and others_collided (two other cars crashed while the trial lasted); and for every
  seat the share of its cars that collided meanwhile (`models.seats`).
- bursts: the message rate in every stretch of five steps (`models.bursts`).

Intervals: Wilson for shares of episodes, else bootstrap over episodes (percentile, 1,000 resamples).

Shapes: T steps, B episodes, N seats, K tokens, R resamples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from models.bursts import Bursts, Windows, bursts, windows
from models.interpret.estimate import EVALUATION, seed_batches
from models.interpret.nulls import in_use
from models.policies.team import Team
from models.rollout import Rollout, Scripted, Trials, episodes, trials
from models.seats import occupancies

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from models.envs.api import Environment

    Sums = NDArray[np.float64]

RESAMPLES = 1_000
WILSON_Z = 1.959964
CHUNK = 50  # resamples drawn at once: 20,000 episodes would fill 160 MB otherwise


class Measure(NamedTuple):
    """A measured value and its 95 % interval."""

    mean: float
    ci95: tuple[float, float]

    def to_json(self) -> dict[str, Any]:
        return {"mean": self.mean, "ci95": list(self.ci95)}


@dataclass(frozen=True, slots=True)
class Question:
    """What to measure.

    Attributes:
        episodes: how many.
        seed: of the episodes; the same seed gives the same numbers.
        start: `init`, or `human` for the trials that participants get (Traffic Junction).
        arrival: probability of a car per entrance and step, None for the world's own.
        masked: nobody hears anything.
    """

    episodes: int
    seed: int = 0
    start: Literal["init", "human"] = "init"
    arrival: float | None = None
    masked: bool = False


class Seat(NamedTuple):
    """The cars of one seat in human trials."""

    seat: int
    participant: bool
    """Whether people sit here."""
    cars: int
    """How many had the seat while a trial lasted."""
    collided: Measure
    """Share of them that shared a cell."""

    def to_json(self) -> dict[str, Any]:
        return {**self._asdict(), "collided": self.collided.to_json()}


@dataclass(frozen=True, slots=True)
class Survey:
    """Everything that was measured.

    Attributes:
        measures: by name, see the module's docstring.
        bursts: message rates in windows; None where messages are held, and where nobody lived.
        seats: of human trials, else empty.
    """

    measures: dict[str, Measure]
    bursts: Bursts | None
    seats: tuple[Seat, ...]

    def to_json(self) -> dict[str, Any]:
        numbers: dict[str, Any] = {name: measure.to_json() for name, measure in self.measures.items()}
        if self.bursts is not None:
            numbers["bursts"] = self.bursts.to_json()
        if self.seats:
            numbers["seats"] = [seat.to_json() for seat in self.seats]
        return numbers


def evaluate(env: Environment[Any], players: Team | Scripted, question: Question) -> dict[str, Measure]:
    """Measure players in a world: the measures of a `survey`.

    Raises:
        ValueError: the world has no such start or no arrivals.
    """
    return survey(env, players, question).measures


def survey(env: Environment[Any], players: Team | Scripted, question: Question) -> Survey:
    """Measure players in a world.

    Raises:
        ValueError: the world has no such start or no arrivals.
    """
    tokens = players.policy.tokens if isinstance(players, Team) else 0
    parts = [
        _columns(env, _play(env, players, question, seeds), tokens, question)
        for seeds in seed_batches(question.episodes, question.seed, EVALUATION)
    ]
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    counted = None if env.message_held else Windows(columns.pop("window_sent"), columns.pop("window_living"))
    booted = Bootstrap(columns, question.seed)
    return Survey(
        _measures(columns, booted), None if counted is None else bursts(counted), _seats(columns, booted)
    )


def _play(
    env: Environment[Any], players: Team | Scripted, question: Question, seeds: NDArray[np.uint64]
) -> Rollout:
    return episodes(env, players, seeds, question.start, question.arrival, question.masked)


def _columns(
    env: Environment[Any], rollout: Rollout, tokens: int, question: Question
) -> dict[str, NDArray[np.float64]]:
    """Everything that is summed or averaged over episodes: (B,), uses (B, K)."""
    speaking = rollout.alive & env.speaks
    columns: dict[str, NDArray[Any]] = {
        "success": rollout.success,
        "reward": rollout.rewards.sum(axis=(0, 2), dtype=np.float64) / env.agents,
        "sent": (rollout.gates & speaking).sum(axis=(0, 2)),
        "speakers": speaking.sum(axis=(0, 2)),
        "slots": rollout.steps * int(env.speaks.sum()),
        "uses": _uses(rollout, tokens, env.message_held),
    }
    if env.message_held:
        columns |= {"found": rollout.success, "steps": rollout.steps}
    else:
        counted = windows(rollout, env.speaks)
        columns |= {"window_sent": counted.sent, "window_living": counted.living}
    if question.start == "human":
        columns |= _outcomes(trials(rollout))
        seats = occupancies(rollout)
        columns |= {"seat_cars": seats.cars, "seat_collided": seats.collided}
    return {name: value.astype(np.float64) for name, value in columns.items()}


def _outcomes(judged: Trials) -> dict[str, NDArray[Any]]:
    return {
        "arrived": judged.arrived,
        "collided": judged.collided,
        "limit": ~(judged.arrived | judged.collided),
        "trial_steps": judged.steps,
        "others_collided": judged.others,
    }


def _uses(rollout: Rollout, tokens: int, held: bool) -> NDArray[np.int64]:
    """Messages sent of each token in each episode: (B, K); one that is held counts once."""
    uses = np.zeros((rollout.success.shape[0], tokens), np.int64)
    if tokens:
        sent = rollout.gates & rollout.alive
        step, episode, seat = np.nonzero(sent[:1] if held else sent)
        np.add.at(uses, (episode, rollout.tokens[step, episode, seat]), 1)
    return uses


SHARES = ("success", "found", "arrived", "collided", "limit", "others_collided")
MEANS = ("reward", "steps", "trial_steps")


def _measures(columns: dict[str, NDArray[np.float64]], booted: Bootstrap) -> dict[str, Measure]:
    count = len(columns["success"])
    measures = {name: wilson(int(columns[name].sum()), count) for name in SHARES if name in columns}
    for name in MEANS:
        if name in columns:
            measures[name] = booted.measure(lambda sums, name=name: sums[name] / count)  # type: ignore[misc]
    for name, per in (("message_rate", "speakers"), ("message_rate_slots", "slots")):
        measures[name] = booted.measure(lambda sums, per=per: sums["sent"] / np.maximum(sums[per], 1))  # type: ignore[misc]
    measures["tokens_used"] = booted.measure(lambda sums: in_use(sums["uses"]).sum(axis=-1))
    return measures


def _seats(columns: dict[str, NDArray[np.float64]], booted: Bootstrap) -> tuple[Seat, ...]:
    """Share of the cars of each seat that collided; trials, not cars, are resampled."""
    if "seat_cars" not in columns:
        return ()
    cars = columns["seat_cars"].sum(0)
    last = len(cars) - 1

    def share(seat: int) -> Measure:
        return booted.measure(
            lambda sums: sums["seat_collided"][:, seat] / np.maximum(sums["seat_cars"][:, seat], 1)
        )

    return tuple(Seat(seat, seat == last, int(cars[seat]), share(seat)) for seat in range(last + 1))


def wilson(hits: int, count: int) -> Measure:
    """Return a share with its Wilson score interval."""
    share, z2 = hits / count, WILSON_Z**2
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = WILSON_Z / (1 + z2 / count) * np.sqrt(share * (1 - share) / count + z2 / (4 * count**2))
    low, high = float(middle - half), float(middle + half)
    return Measure(share, (max(0.0, min(low, share)), min(1.0, max(high, share))))  # rounding aside


class Bootstrap:
    """Column sums over episodes, as they are and in resamples of whole episodes."""

    def __init__(self, columns: dict[str, NDArray[np.float64]], seed: int) -> None:
        self._sums = {name: value.sum(axis=0, keepdims=True) for name, value in columns.items()}
        count = len(next(iter(columns.values())))
        rng, even = np.random.default_rng(seed), np.full(count, 1 / count)
        chunks = []
        for _ in range(RESAMPLES // CHUNK):
            draws = rng.multinomial(count, even, CHUNK).astype(np.float64)  # (CHUNK, B)
            chunks.append({name: draws @ value for name, value in columns.items()})
        self._resampled = {name: np.concatenate([chunk[name] for chunk in chunks]) for name in columns}

    def measure(self, statistic: Callable[[dict[str, Sums]], NDArray[Any]]) -> Measure:
        """Return a statistic of the sums, which has one value per row, and its percentile interval."""
        values = np.asarray(statistic(self._resampled), np.float64)  # (R,)
        low, high = np.quantile(values, [0.025, 0.975])
        return Measure(float(np.asarray(statistic(self._sums))[0]), (float(low), float(high)))
