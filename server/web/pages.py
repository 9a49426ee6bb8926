"""What each page's template gets: one frozen dataclass a page, its fields become the template's variables.

A template that names anything else fails (StrictUndefined), and a test compares the two lists. Contexts hold
finished values only: no rows, no services, nothing about arm or condition.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, Protocol

Task = Literal["parent_child", "traffic_junction"]
Role = Literal["parent", "child", "driver"]
Icon = Literal["good", "info", "wait", "warn", "stop"]


class Page(Protocol):
    """A dataclass instance with the path of its template below templates/."""

    template: ClassVar[str]


@dataclass(frozen=True, slots=True)
class Action:
    """A link that goes on from a message page."""

    label: str
    url: str


@dataclass(frozen=True, slots=True)
class Bar:
    """What stands at the edge of every page of a session: how far, how long, for what; help and the way out.

    `pay` and `bonus` are finished words (empty: the study states neither); `bonus` is what was earned so far.
    """

    rounds_over: int
    rounds: int
    minutes: int
    pay: str
    bonus: str
    bonus_rule: str
    contact: str
    withdraw_url: str


@dataclass(frozen=True, slots=True)
class Question:
    """One item of a form as its template needs it; `value` is what was answered so far."""

    key: str
    text: str
    kind: Literal["choice", "scale", "number", "text", "cell"]
    options: tuple[tuple[str, str], ...]
    """Value and label of each answer of a choice; values of a scale (label empty)."""
    low: str
    high: str
    minimum: str
    maximum: str
    required: bool
    value: str
    error: str


@dataclass(frozen=True, slots=True)
class ConsentPage:
    """The entry page.

    `welcome` is the lead, `agree_text` stands beside the tick (both in the study's texts). A paragraph
    "Heading: text" gets its heading. The form posts to `action`: the hidden `identifiers`; the button's
    `agree` = "yes" or "no"; the tick `read` = "yes"; and what the browser says about itself: `device`
    (desktop, tablet, phone), `browser`, `viewport` ("1280x720"), all three empty without scripts.
    """

    template: ClassVar[str] = "participant/consent.html"
    study_title: str
    welcome: str
    paragraphs: tuple[str, ...]
    agree_text: str
    contact: str
    facts: tuple[tuple[str, str], ...]
    identifiers: Mapping[str, str]
    action: str
    screened_url: str
    """Where the hidden identifiers are posted to, with `reason`, when the device does not fit."""
    gate: Mapping[str, Any]
    """JSON of #gate: width_min, height_min, refresh_min_hz, keyboard, keys (names of keys to press)."""
    kept_text: str
    """What is kept of who says no."""
    language: str
    direction: str
    error: str | None = None


@dataclass(frozen=True, slots=True)
class Rules:
    """What is said of a role before it is played."""

    role: Role
    limit: int
    child_sees_parent: bool
    paragraphs: tuple[str, ...]
    level: Literal[1, 2] = 1
    """Of the heading."""


@dataclass(frozen=True, slots=True)
class InstructionsPage:
    """How to play one block; `page` goes back as a hidden field of the form to `next_url`."""

    template: ClassVar[str] = "participant/instructions.html"
    title: str
    task: Task
    role: Role
    block: int
    blocks: int
    rounds: int
    practice_rounds: int
    limit: int
    child_sees_parent: bool
    rules: Rules
    page: str
    next_url: str
    quiz: bool
    """Whether questions about the game follow."""
    bar: Bar
    events_url: str
    language: str
    direction: str


@dataclass(frozen=True, slots=True)
class PlayPage:
    """The page of the board; `data` is the JSON of #page-data and repeats what the scripts need.

    In it `won` are the rounds won so far, and `bonuses` what so many are worth (empty: no bonus).
    """

    template: ClassVar[str] = "participant/play.html"
    title: str
    task: Task
    role: Role
    block: int
    blocks: int
    rounds: int
    limit: int
    round_url: str
    step_url: str
    page_url: str
    data: Mapping[str, Any]
    bar: Bar
    language: str
    direction: str


@dataclass(frozen=True, slots=True)
class FormPage:
    """Questions: a quiz, an attention check, a questionnaire, or the probe of the signs.

    The form posts to `answers_url`: hidden `form` and `attempt`, for each item `a.<key>` with the answer and
    `t.<key>` with JSON {first_ms, last_ms, changes}, filled in by the script. `signs` (probe only) are the
    board's and the tokens' drawing data. `again` says what was wrong at an attempt before.
    """

    template: ClassVar[str] = "participant/form.html"
    title: str
    kind: Literal["quiz", "attention", "questionnaire", "probe"]
    heading: str
    lead: str
    form: str
    attempt: int
    tries_left: int
    items: tuple[Question, ...]
    again: str
    rules: Rules | None
    """To be read once more, at a second try of the quiz."""
    error: str
    answers_url: str
    data: Mapping[str, Any]
    """JSON of #page-data: events_url, the page's name in the log, and for the probe size and signs."""
    bar: Bar
    language: str
    direction: str


@dataclass(frozen=True, slots=True)
class EndPage:
    """Every end that somebody who was in the study can come to; says what to do next.

    With `fields` the way back is a form that posts them to `url` (MTurk), without it is a link (Prolific);
    without `url` the code is all there is; without `code` nothing is to be handed in, and `elsewhere` is a
    link that goes on. `paid` lines say what will be paid. `goes_by_itself`: the way back is taken after a
    countdown.
    """

    template: ClassVar[str] = "participant/end.html"
    title: str
    state: str
    icon: Icon
    heading: str
    paragraphs: tuple[str, ...]
    code: str
    marketplace: str
    url: str | None
    rounds_stored: int
    rounds: int
    paid: tuple[tuple[str, str], ...]
    goes_by_itself: bool
    language: str
    direction: str
    elsewhere: Action | None = None
    fields: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class WithdrawPage:
    """Asks who wants to stop whether the data may be kept; posts `keep` = yes or no to `action`."""

    template: ClassVar[str] = "participant/withdraw.html"
    title: str
    partial: str
    """What will be paid; empty: the study says nothing about it."""
    action: str
    back_url: str
    language: str
    direction: str


@dataclass(frozen=True, slots=True)
class MessagePage:
    """Any state that is only told: declined, full, paused, closed, preview, unknown study or session."""

    template: ClassVar[str] = "participant/message.html"
    title: str
    heading: str
    paragraphs: tuple[str, ...]
    icon: Icon = "info"
    action: Action | None = None


@dataclass(frozen=True, slots=True)
class ErrorPage:
    """A request that could not be answered; `incident` is what the log line is found by."""

    template: ClassVar[str] = "errors/error.html"
    status: int
    heading: str
    paragraphs: tuple[str, ...]
    incident: str | None = None
    action: Action | None = None
