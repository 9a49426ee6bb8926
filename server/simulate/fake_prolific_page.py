"""The fake marketplace for a person: studies, submissions, and a button for all that a participant can do."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template

from server.simulate.fake_prolific_market import Market
from server.simulate.fake_prolific_records import Study, Submission

TEMPLATES = Path(__file__).parents[2] / "templates"
LOOKS = {
    "ACTIVE": ("badge-good", "●"),
    "APPROVED": ("badge-good", "✓"),
    "COMPLETED": ("badge-good", "✓"),
    "AWAITING REVIEW": ("badge-accent", "◐"),
    "RESERVED": ("badge-accent", "○"),
    "PUBLISHING": ("badge-accent", "○"),
    "PAUSED": ("badge-warn", "‖"),
    "REJECTED": ("badge-bad", "×"),
}
OTHERWISE = ("", "○")


@dataclass(frozen=True, slots=True)
class Row:
    it: Submission
    paid_minor: int


@dataclass(frozen=True, slots=True)
class Line:
    study: Study
    taken: int
    open: bool
    submissions: tuple[Row, ...]


@cache
def template() -> Template:
    jinja = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined)
    return jinja.get_template("fake/prolific.html")


def page(market: Market, notice: str = "") -> str:
    """The HTML page as things stand."""
    market.settle()
    lines = [line(market, study) for study in reversed(market.studies.values())]
    return template().render(studies=lines, notice=notice, looks=LOOKS, otherwise=OTHERWISE)


def line(market: Market, study: Study) -> Line:
    taken = market.taken(study.id)
    rows = tuple(Row(each, paid(market, each.id)) for each in reversed(market.of_study(study.id)))
    return Line(study, taken, study.status == "ACTIVE" and taken < study.places, rows)


def paid(market: Market, submission_id: str) -> int:
    return sum(each.amount_minor for each in market.payments if each.submission_id == submission_id)
