"""What people answered, did with their window and went through, as CSV rows: pure functions like `tidy`'s.

An answer is one row, whatever it was asked in. A value is a number wherever the question asks for one; words
are kept as they were written.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from server.domain import canonical, forms
from server.domain.questionnaire import Item
from server.domain.study import StudyDefinition
from server.services.probe import Mark
from server.services.tidy import DIGITS_MS, FLAG, Cells, Row
from server.storage.answers import AnswerRow
from server.storage.browser_log import BrowserEventRow
from server.storage.journeys import JourneyRow

DIGITS_PROBABILITY = 6
PROBE = "probe"


def answer_rows(
    study: str, person: Row, definition: StudyDefinition, answers: Sequence[AnswerRow]
) -> Iterator[Cells]:
    """Build the rows of answers.csv of one person."""
    head = (study, person["study_version"], person["mode"], person["id"], person["arm"])
    items = {row.form: forms.items_of(definition, row.form) for row in answers}
    keyed = sorted((place(definition, row), row) for row in answers)
    for (form, block, attempt, key), row in keyed:
        item = items[row.form].get(key)
        yield (
            *head,
            form,
            block,
            attempt,
            key,
            value(item, row.value),
            (item.label(row.value) or None) if item else None,
            FLAG[row.correct],
            rounded(row.first_ms),
            rounded(row.last_ms),
            row.changes,
            row.stored_utc,
        )


def place(definition: StudyDefinition, row: AnswerRow) -> tuple[str, int, int, str]:
    """The key of an answer within a person: form, block, attempt, item."""
    return row.form.partition(":")[0], forms.block_of(definition, row.form), row.attempt, row.item


def value(item: Item | None, text: str) -> str | float | None:
    """A number where the question asks for one (of a choice the option's number), else what was written."""
    if not text:
        return None
    if item is None or item.kind == "text":
        return text
    number = float(text)
    return int(number) if number.is_integer() else number


def rounded(ms: float | None) -> float | None:
    return None if ms is None else round(ms, DIGITS_MS)


def probe_rows(person: Row, definition: StudyDefinition, marks: Sequence[Mark]) -> Iterator[Cells]:
    """Build the rows of probe.csv of one person, in the order of the signs."""
    head = (person["id"], person["arm"], definition.arm(person["arm"]).communication)
    for mark in sorted(marks, key=lambda mark: mark.sign):
        scores = (mark.probability, mark.best, mark.distance, mark.least)
        yield (
            *head,
            *mark[: -len(scores)],
            *(None if score is None else round(score, DIGITS_PROBABILITY) for score in scores),
        )


def browser_event_rows(events: Iterator[BrowserEventRow]) -> Iterator[Cells]:
    """Build the rows of browser_events.csv."""
    for event in events:
        yield event._replace(at_ms=round(event.at_ms, DIGITS_MS))


def journey_rows(journeys: Sequence[JourneyRow]) -> Iterator[Cells]:
    """Build the rows of journey.csv."""
    yield from journeys


def permuted(person: Row, name: str) -> Sequence[int]:
    """A stored permutation; empty where the study has no panel."""
    found: Sequence[int] = canonical.loads(person[name] or "[]")
    return found


def by_person(rows: Sequence[AnswerRow]) -> Mapping[str, Sequence[AnswerRow]]:
    """The answers of each person who gave some."""
    found: dict[str, list[Any]] = {}
    for row in rows:
        found.setdefault(row.participant_id, []).append(row)
    return found
