"""Events of a trial: their bodies, what may stand in them, and the digests that chain them.

Event 0 `start`: whose trial it is (its id and the participant's mode), the spec, and what was said and
shown first. Event n >= 1 `decision`: the person's action and timing; the world steps that it caused, each
with every seat's action; after each step every seat's token and gate in the new state; and what the answer
showed, as numbers (`saw`). `stored_utc` stands in the body too, so that the digest covers it.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from models.vocabulary import SILENT
from server.domain import canonical
from server.domain.errors import BadInputError
from server.domain.spec import TrialSpec

DAY_MS = 86_400_000.0
STAMP_MAX_MS = 1_000 * DAY_MS
RT_TOLERANCE_MS = 1e-6  # of a difference of two doubles near a day in milliseconds
Body = dict[str, Any]


class Said(NamedTuple):
    """Token and gate of every seat in one state."""

    tokens: tuple[int, ...]
    gates: tuple[bool, ...]


class Move(NamedTuple):
    """One world step: what every seat did, and what was said in the state that came of it."""

    actions: tuple[int, ...]
    said: Said


@dataclass(frozen=True, slots=True)
class Saw:
    """What was on the screen after an event, as numbers. Cells count from 0."""

    row: int
    col: int
    messages_heard: int
    """Open gates of others, null tokens included."""
    messages_drawn: int
    """Those that put something on the screen."""
    triangle_max: float | None
    """Likelihood of the largest triangle, 0 where there is none; None where the screen has no triangles."""
    sign: int | None
    """The number that was highlighted."""

    def to_dict(self) -> Body:
        return {name: getattr(self, name) for name in self.__slots__}


def silence(agents: int) -> Said:
    return Said((SILENT,) * agents, (False,) * agents)


def start_body(trial_id: str, mode: str, spec: TrialSpec, said: Said, saw: Saw, stored_utc: str) -> Body:
    return {
        "kind": "start",
        "trial": trial_id,
        "mode": mode,
        "spec": spec.model_dump(mode="json"),
        "tokens": list(said.tokens),
        "gates": list(said.gates),
        "saw": saw.to_dict(),
        "stored_utc": stored_utc,
    }


def decision_body(
    action: int,
    token: int | None,
    timing: Mapping[str, Any],
    moves: tuple[Move, ...],
    saw: Saw,
    stored_utc: str,
) -> Body:
    return {
        "kind": "decision",
        "action": action,
        "token": token,
        "timing": dict(timing),
        "moves": [
            {"actions": list(m.actions), "tokens": list(m.said.tokens), "gates": list(m.said.gates)}
            for m in moves
        ],
        "saw": saw.to_dict(),
        "stored_utc": stored_utc,
    }


def said_in(body: Mapping[str, Any]) -> Said:
    return Said(tuple(body["tokens"]), tuple(body["gates"]))


def moves_in(body: Mapping[str, Any]) -> tuple[Move, ...]:
    return tuple(Move(tuple(move["actions"]), said_in(move)) for move in body["moves"])


def digest(previous: str, body: str) -> str:
    """sha256(previous digest + canonical body); before event 0 the previous digest is empty."""
    return canonical.sha256(previous + body)


def same_answer(body: Mapping[str, Any], action: int, timing: Mapping[str, Any]) -> bool:
    """Whether a stored decision is the one that is being sent (again)."""
    return bool(body["action"] == action) and canonical.dumps(body["timing"]) == canonical.dumps(dict(timing))


def number(low: float, high: float) -> Callable[[Any], bool]:
    def fits(value: Any) -> bool:
        return type(value) in {int, float} and math.isfinite(value) and low <= value <= high

    return fits


def count(high: int) -> Callable[[Any], bool]:
    def fits(value: Any) -> bool:
        return type(value) is int and 0 <= value <= high

    return fits


def optional(rule: Callable[[Any], bool]) -> Callable[[Any], bool]:
    def fits(value: Any) -> bool:
        return value is None or rule(value)

    return fits


def flag(value: Any) -> bool:
    return type(value) is bool


def device(value: Any) -> bool:
    return value in {"key", "click"}


TIMING: dict[str, Callable[[Any], bool]] = {
    "onset_ms": number(0, STAMP_MAX_MS),
    "response_ms": number(0, STAMP_MAX_MS),
    "rt_ms": number(-DAY_MS, STAMP_MAX_MS),  # below 0 if the stamps disagree; then not valid
    "handler_lag_ms": number(-DAY_MS, STAMP_MAX_MS),
    "wait_ms": optional(number(-DAY_MS, STAMP_MAX_MS)),
    "is_trusted": flag,
    "hidden": flag,
    "resumed": flag,
    "refresh_hz": optional(number(1e-3, 10_000)),
    "dropped_frames": count(1_000_000),
    "board_px": count(100_000),
    "early_keys": count(1_000_000),
    "input": device,
}
"""Every field of a decision's timing and what it may hold. Times in ms of the page's own clock."""


def timing_error(timing: Mapping[str, Any]) -> str | None:
    """What is wrong with a timing, in one line."""
    if timing.keys() != TIMING.keys():
        odd = ", ".join(sorted(timing.keys() ^ TIMING.keys()))
        return f"timing: fields missing or unknown: {odd}"
    for name, fits in TIMING.items():
        if not fits(timing[name]):
            return f"timing.{name}: {timing[name]!r} cannot be"
    if abs(timing["response_ms"] - timing["onset_ms"] - timing["rt_ms"]) > RT_TOLERANCE_MS:
        return "timing.rt_ms: is not response_ms - onset_ms"
    return None


def check_timing(timing: Mapping[str, Any]) -> None:
    """Refuse a timing that no page of ours sends.

    Raises:
        BadInputError: names the field.
    """
    if error := timing_error(timing):
        raise BadInputError(error)


def rt_valid(timing: Mapping[str, Any]) -> bool:
    """Whether nothing came between onset and response that makes their difference no reaction time."""
    return not timing["hidden"] and not timing["resumed"] and timing["rt_ms"] >= 0
