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
    error: str | None = None


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
    paragraphs: tuple[str, ...]
    page: str
    next_url: str


@dataclass(frozen=True, slots=True)
class PlayPage:
    """The page of the board; `data` is the JSON of #page-data and repeats what the scripts need."""

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


@dataclass(frozen=True, slots=True)
class CompletePage:
    """The code and the way back.

    With `fields` the way back is a form that posts them to `url` (MTurk), without it is a link (Prolific);
    without `url` the code is all there is (direct).
    """

    template: ClassVar[str] = "participant/complete.html"
    title: str
    code: str
    marketplace: str
    url: str | None
    rounds_stored: int
    rounds: int
    text: str
    fields: Mapping[str, str] = field(default_factory=dict)


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
