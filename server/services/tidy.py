"""Stored rows to CSV rows: pure functions from a participant, a trial and its events to the codebook.

A decision of seq n is described by what was shown before it, which event n - 1 holds, and by its own timing.
A cell is `None` where the value does not exist. No database, no files; only booleans are formatted here.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.vocabulary import SILENT
from server.domain.events import rt_valid
from server.domain.flow import ABANDONED, exclusion_reason
from server.domain.money import bonus_minor, reward_minor
from server.domain.participation import WENT_THROUGH
from server.domain.study import Pay
from server.services import codebook

Row = Mapping[str, Any]
Cells = tuple[Any, ...]
FLAG: Mapping[Any, str | None] = {True: "true", False: "false", None: None}
GOOD_OUTCOMES = frozenset({"found", "arrived"})
BAD_OUTCOMES = frozenset({"not_found", "collision", "limit"})
ACTION_NAMES: Mapping[str, tuple[str, ...]] = {
    "parent": ("up", "right", "down", "left"),
    "driver": ("go", "brake"),
}
CHILD_SEAT = 1
DIGITS_MS = 3


class Decision(NamedTuple):
    """Event n ≥ 1 of a trial; `saw` is what event n - 1 had put on the screen."""

    seq: int
    body: Row
    saw: Row
    stored_utc: str


@dataclass(frozen=True, slots=True)
class Story:
    """One stored trial: its row, its start event and its decisions in order."""

    trial: Row
    start: Row
    decisions: tuple[Decision, ...]

    @property
    def spec(self) -> Row:
        spec: Row = self.start["spec"]
        return spec

    @property
    def seat(self) -> int:
        """The participant's seat."""
        return list(self.spec["seats"]).index("human")


class Entry(NamedTuple):
    """What the driver found: other cars driving, and the length of the own route."""

    cars: int
    route_length: int


class Track(NamedTuple):
    """Where everybody was, one entry a world step (T, N): -1 where nobody was.

    `after` is the cell of the one who acted, so it is -1 where a car has left, whoever took the seat since.
    """

    before: NDArray[np.int32]
    after: NDArray[np.int32]


def story(trial: Row, events: Sequence[tuple[int, Row, str]]) -> Story:
    """Pair every decision of (seq, body, stored_utc) with what was on the screen before it."""
    bodies = [body for _, body, _ in events]
    decisions = tuple(
        Decision(seq, body, before["saw"], stored)
        for (seq, body, stored), before in zip(events[1:], bodies, strict=False)
    )
    return Story(trial, bodies[0], decisions)


class Tally(NamedTuple):
    """What is counted of a person; None where the data were erased."""

    won: int | None
    attention_failed: int | None


def participant_row(study: str, person: Row, counted: Tally, pay: Pay | None, *, left: bool) -> Cells:
    """Build a row of participants.csv; `left`: unfinished, and not heard of for longer than the lease."""
    status = ABANDONED if left else person["status"]
    reason = exclusion_reason(status)
    own = {
        **person,
        **counted._asdict(),
        **money_of(pay, status, counted.won or 0),
        "study": study,
        "participant": person["id"],
        "status": status,
        "token_permutation": permutation(person["token_permutation"]),
        "number_permutation": permutation(person["number_permutation"]),
        "excluded": FLAG[reason is not None],
        "exclusion_reason": reason,
        "erased": FLAG[person["erased_utc"] is not None],
    }
    return tuple(own[column.name] for column in codebook.PARTICIPANTS)


def money_of(pay: Pay | None, status: str, won: int) -> dict[str, Any]:
    """What the study's rule gives to somebody of this status; empty where the study states no pay."""
    if pay is None:
        return dict.fromkeys(("currency", "reward_minor", "bonus_minor"))
    return {
        "currency": pay.currency,
        "reward_minor": reward_minor(pay, status),
        "bonus_minor": bonus_minor(pay, won) if status in WENT_THROUGH else 0,
    }


def permutation(stored: str | None) -> str | None:
    """Write a stored JSON list as numbers between spaces.

    >>> permutation("[2,0,1]")
    '2 0 1'
    """
    numbers = (stored or "").strip("[]")
    return numbers.replace(" ", "").replace(",", " ") or None


def trial_row(study: str, person: Row, told: Story, entry: Entry | None, *, left: bool) -> Cells:
    """Build a row of trials.csv; `entry` is None outside Traffic Junction."""
    trial, spec, condition = told.trial, told.spec, told.spec["condition"]
    outcome = trial["outcome"] or (ABANDONED if left else None)
    bundle = spec["bundle"] or {}
    own = {
        **trial,
        **sign(told),
        **reaction_times(told),
        "study": study,
        "study_version": person["study_version"],
        "mode": person["mode"],
        "participant": person["id"],
        "arm": person["arm"],
        "task": task(spec),
        "task_version": spec["task_version"],
        "trial": trial["number"],
        "trial_id": trial["id"],
        "communication": condition["communication"],
        "budget": condition["budget"],
        "overlay": FLAG[condition["overlay"]],
        "bundle": bundle.get("name"),
        "bundle_sha256": bundle.get("sha256"),
        "scripted": spec["scripted"],
        "outcome": outcome,
        "success": success(outcome),
        "progress": trial["progress"] if entry else None,
        "route_length": entry.route_length if entry else None,
        "cars_at_entry": entry.cars if entry else None,
        "decisions": len(told.decisions),
    }
    return tuple(own[column.name] for column in codebook.TRIALS)


def task(spec: Row) -> str:
    """Name the task without its size: `traffic_junction/medium` is traffic_junction."""
    return str(spec["task"]).partition("/")[0]


def success(outcome: str | None) -> str | None:
    if outcome in GOOD_OUTCOMES:
        return "true"
    return "false" if outcome in BAD_OUTCOMES else None


def sign(told: Story) -> dict[str, int | None]:
    """The token of a Parent & Lost Child trial, its number on screen and its place on the panel."""
    token = spoken(told)
    panel = told.spec["condition"]["panel"]
    if token is None or panel is None:
        return {"token": token, "token_shown": None, "position": None}
    position = panel["position_of_token"][token]
    blank = told.spec["condition"]["blank"]
    shown = None if blank else panel["number_at_position"][position]
    return {"token": token, "token_shown": shown, "position": position}


def spoken(told: Story) -> int | None:
    role = told.trial["role"]
    if role == "child":
        return told.decisions[0].body["token"] if told.decisions else None
    if role == "parent":
        return said(told.start["tokens"][CHILD_SEAT])
    return None


def said(token: int) -> int | None:
    return None if token == SILENT else token


def reaction_times(told: Story) -> dict[str, float | int | None]:
    valid = [d.body["timing"]["rt_ms"] for d in told.decisions if rt_valid(d.body["timing"])]
    return {
        "rt_valid_count": len(valid),
        "rt_ms_mean": round(fmean(valid), DIGITS_MS) if valid else None,
        "rt_ms_median": round(median(valid), DIGITS_MS) if valid else None,
    }


def step_rows(told: Story) -> Iterator[Cells]:
    """Build the rows of steps.csv of one trial."""
    trial = told.trial
    head = (trial["participant_id"], trial["id"])
    phase, role = trial["phase"], trial["role"]
    names = ACTION_NAMES.get(role)
    for seq, body, saw, stored_utc in told.decisions:
        timing, action = body["timing"], body["action"]
        yield (
            *head,
            seq,
            phase,
            role,
            action,
            names[action] if names else "sign",
            timing["rt_ms"],
            FLAG[rt_valid(timing)],
            timing["onset_ms"],
            timing["response_ms"],
            timing["handler_lag_ms"],
            timing["wait_ms"],
            FLAG[timing["is_trusted"]],
            FLAG[timing["hidden"]],
            FLAG[timing["resumed"]],
            timing["refresh_hz"],
            timing["dropped_frames"],
            timing["board_px"],
            timing["early_keys"],
            timing["input"],
            saw["row"],
            saw["col"],
            saw["messages_heard"],
            saw["messages_drawn"],
            saw["triangle_max"],
            stored_utc,
        )


def moves(told: Story) -> Iterator[tuple[int, Sequence[int], Sequence[bool], Sequence[int]]]:
    """Yield seq, tokens, gates and actions of every world step: what was said in a state and done then."""
    tokens, gates = told.start["tokens"], told.start["gates"]
    for seq, body, _, _ in told.decisions:
        if told.trial["role"] == "child":
            tokens, gates = [SILENT, body["token"]], [False, True]
        for move in body["moves"]:
            yield seq, tokens, gates, move["actions"]
            tokens, gates = move["tokens"], move["gates"]


def world_actions(told: Story) -> list[Sequence[int]]:
    """The actions of every seat, one list a world step."""
    return [move["actions"] for decision in told.decisions for move in decision.body["moves"]]


def sources(told: Story) -> list[str]:
    """Who speaks for each seat."""
    own = "human" if told.trial["role"] == "child" else "ghost"
    return [own if seat == "human" else seat for seat in told.spec["seats"]]


def agent_rows(told: Story, track: Track) -> Iterator[Cells]:
    """Build the rows of agents.csv of one trial."""
    trial_id, own, source = told.trial["id"], told.seat, sources(told)
    own_flags = [FLAG[seat == own] for seat in range(len(source))]
    before, after = track.before.tolist(), track.after.tolist()
    for step, (seq, tokens, gates, actions) in enumerate(moves(told)):
        cells, cells_next = before[step], after[step]
        for seat, cell in enumerate(cells):
            if cell < 0:
                continue
            token, cell_next = tokens[seat], cells_next[seat]
            yield (
                trial_id,
                seq,
                step + 1,
                seat,
                own_flags[seat],
                source[seat],
                cell,
                None if token == SILENT else token,
                FLAG[gates[seat]],
                actions[seat],
                None if cell_next < 0 else cell_next,
            )
