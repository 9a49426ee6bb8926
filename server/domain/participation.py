"""Where somebody stands in a study, and what every event does to that: one total function.

A participant is in exactly one `State`. `after(state, event)` is defined for every pair: most events move
nobody who is not waiting for them. What is stored is a status (the end that somebody came to, or `active`)
and a page of the plan; the stages of an active participant follow from the page (`stage_of`).

Nobody is ever rejected by us: `REJECTED` and `RETURNED` are what a marketplace tells. Whoever the study could
not take or who failed the quiz is screened out, which is not a rejection.
"""

from collections.abc import Mapping
from enum import StrEnum

from server.domain.plan import page_kind


class State(StrEnum):
    INVITED = "invited"
    """Has a link, and nothing else; nothing is known of them."""
    SCREENED = "screened"
    """The browser can do what the study needs. Only the browser knows that."""
    CONSENTED = "consented"
    INSTRUCTED = "instructed"
    PRACTISED = "practised"
    QUIZZED = "quizzed"
    PLAYING = "playing"
    """Block and trial follow from the page and the stored rounds."""
    SURVEYED = "surveyed"
    """All rounds are over; the last questions are open."""
    FINISHED = "finished"
    DECLINED = "declined"
    SCREENED_OUT = "screened_out"
    FAILED = "failed"
    """Went through everything, but failed too many attention checks: thanked, and looked at by a person."""
    TIMED_OUT = "timed_out"
    WITHDRAWN = "withdrawn"
    RETURNED = "returned"
    REJECTED = "rejected"


class Event(StrEnum):
    DEVICE_FITS = "device_fits"
    DEVICE_UNFIT = "device_unfit"
    AGREE = "agree"
    DECLINE = "decline"
    READ = "read"
    """Went on from the instructions."""
    PRACTICE_OVER = "practice_over"
    QUIZ_PASSED = "quiz_passed"
    QUIZ_MISSED = "quiz_missed"
    """A wrong answer, with a try left."""
    QUIZ_FAILED = "quiz_failed"
    """A wrong answer at the last try."""
    ROUND_OVER = "round_over"
    BLOCK_OVER = "block_over"
    ROUNDS_OVER = "rounds_over"
    """The last block is over."""
    ALL_ANSWERED = "all_answered"
    """Nothing is left to do."""
    ALL_ANSWERED_INATTENTIVE = "all_answered_inattentive"
    """Nothing is left to do, but the study's rule excludes these data."""
    WITHDRAW = "withdraw"
    PLACE_LOST = "place_lost"
    """Came back after the lease, and the place had been taken."""
    RETURN_TOLD = "return_told"
    """The marketplace says that the place was given back."""
    TIME_OUT_TOLD = "time_out_told"
    REJECTION_TOLD = "rejection_told"
    TOOK_AGAIN = "took_again"
    """Came back under a new submission."""


STAGES = (
    State.CONSENTED,
    State.INSTRUCTED,
    State.PRACTISED,
    State.QUIZZED,
    State.PLAYING,
    State.SURVEYED,
)
"""An active participant is in one of these, in this order (what a study leaves out is skipped)."""
BEFORE = (State.INVITED, State.SCREENED)
ENDS = tuple(state for state in State if state not in {*STAGES, *BEFORE})

WENT_THROUGH = frozenset({State.FINISHED, State.FAILED})
"""Ends of who did everything, attentive or not: they get the whole reward and the bonus."""

ACTIVE = "active"
"""Status of everybody in one of the stages."""

MOVES: Mapping[tuple[State, Event], State] = {
    (State.INVITED, Event.DEVICE_FITS): State.SCREENED,
    (State.INVITED, Event.DEVICE_UNFIT): State.SCREENED_OUT,
    (State.SCREENED, Event.DEVICE_UNFIT): State.SCREENED_OUT,
    (State.SCREENED, Event.AGREE): State.CONSENTED,
    (State.SCREENED, Event.DECLINE): State.DECLINED,
    (State.INVITED, Event.DECLINE): State.DECLINED,
    (State.CONSENTED, Event.READ): State.INSTRUCTED,
    (State.INSTRUCTED, Event.PRACTICE_OVER): State.PRACTISED,
    (State.PRACTISED, Event.QUIZ_PASSED): State.QUIZZED,
    (State.PRACTISED, Event.QUIZ_FAILED): State.SCREENED_OUT,
    (State.QUIZZED, Event.ROUND_OVER): State.PLAYING,
    (State.PLAYING, Event.BLOCK_OVER): State.CONSENTED,
    (State.PLAYING, Event.ROUNDS_OVER): State.SURVEYED,
    (State.SURVEYED, Event.ALL_ANSWERED): State.FINISHED,
    (State.SURVEYED, Event.ALL_ANSWERED_INATTENTIVE): State.FAILED,
    **{(stage, Event.WITHDRAW): State.WITHDRAWN for stage in STAGES},
    **{(stage, Event.PLACE_LOST): State.TIMED_OUT for stage in STAGES},
    **{(stage, Event.RETURN_TOLD): State.RETURNED for stage in STAGES},
    **{(stage, Event.TIME_OUT_TOLD): State.TIMED_OUT for stage in STAGES},
    **{(stage, Event.REJECTION_TOLD): State.REJECTED for stage in STAGES},
    (State.TIMED_OUT, Event.RETURN_TOLD): State.RETURNED,
    (State.TIMED_OUT, Event.REJECTION_TOLD): State.REJECTED,
    (State.RETURNED, Event.REJECTION_TOLD): State.REJECTED,
    (State.RETURNED, Event.TOOK_AGAIN): State.CONSENTED,
    (State.TIMED_OUT, Event.TOOK_AGAIN): State.CONSENTED,
}
"""Every pair that moves somebody. `TOOK_AGAIN` leads back to the stage of the page that was left."""


def after(state: State, event: Event) -> State:
    """Where `event` leads somebody who is in `state`; the same state where it leads nowhere."""
    return MOVES.get((state, event), state)


def moves(state: State, event: Event) -> bool:
    return (state, event) in MOVES


def stage_of(page: str, *, last_block: bool, begun: bool) -> State:
    """The stage of an active participant.

    Args:
        page: of the plan.
        last_block: whether no block comes after the page's.
        begun: whether a main round of the page's block has ended.
    """
    kind, block = page_kind(page)
    if kind == "play":
        return State.PLAYING if begun else State.QUIZZED
    if kind == "survey" and block and not last_block:
        return State.PLAYING
    return {
        "instructions": State.CONSENTED,
        "practice": State.INSTRUCTED,
        "quiz": State.PRACTISED,
    }.get(kind, State.SURVEYED)


def state_of(status: str, stage: State) -> State:
    """The state behind a stored status, given the stage of the page."""
    return stage if status == ACTIVE else State(status)


def diagram() -> str:
    """The moves as a Mermaid state diagram, one arrow a pair of states."""
    arrows: dict[tuple[State, State], list[str]] = {}
    for (state, event), target in MOVES.items():
        arrows.setdefault((state, target), []).append(event.value.replace("_", " "))
    lines = ["stateDiagram-v2", "  direction TB", "  [*] --> invited"]
    lines += [f"  {a} --> {b}: {', '.join(events)}" for (a, b), events in arrows.items()]
    lines += [f"  {state} --> [*]" for state in ENDS]
    return "\n".join(lines)
