"""Answering: a form is handed in, and what follows from that."""

from collections.abc import Mapping
from dataclasses import dataclass

from server.domain import forms, questionnaire
from server.domain.errors import BadInputError
from server.domain.forms import Form
from server.domain.participation import Event
from server.domain.plan import page_kind
from server.domain.questionnaire import Question
from server.domain.study import Role
from server.services import journey, pages
from server.services.due import due_form
from server.services.journey import PARTICIPANT
from server.services.lab import Lab
from server.services.session import Session, session_of
from server.storage import answers, participants
from server.storage.answers import AnswerRow
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow


class FormError(BadInputError):
    """Answers that cannot be stored: one message per item; nothing was kept."""

    def __init__(self, form: Form, fields: Mapping[str, str]) -> None:
        super().__init__("Please look at the marked questions.")
        self.form = form
        self.fields = dict(fields)


@dataclass(frozen=True, slots=True)
class ItemTiming:
    """When an answer was given, in ms from the moment the form was drawn; None: not measured."""

    first_ms: float | None = None
    last_ms: float | None = None
    changes: int | None = None


UNTIMED = ItemTiming()


def hand_in(
    db: DbSession,
    lab: Lab,
    participant: ParticipantRow,
    name: str,
    attempt: int,
    given: Mapping[str, str],
    timings: Mapping[str, ItemTiming],
) -> None:
    """Store a form and go on from it. A form that is not due (any more) changes nothing.

    Raises:
        FormError: an answer is missing or cannot be.
    """
    participant = participants.hold(db, participant.id)
    session = session_of(db, lab, participant)
    form = due_form(db, session) if participant.status == "active" else None
    if form is None or (form.name, form.attempt) != (name, attempt):
        return
    kept = {item.key: given.get(item.key, "").strip() for item in form.items}
    wrong = questionnaire.problems(form.items, kept) or probe_problems(form, kept)
    if wrong:
        raise FormError(form, wrong)
    right = forms.right_answers(session.study, form.name, role_of(session))
    answers.add(db, rows_of(lab, participant, form, kept, right, timings))
    go_on(db, lab, session, form, all(right[key].is_right(kept[key]) for key in right))


def role_of(session: Session) -> Role:
    _, block = page_kind(session.participant.page)
    return session.plan.of_block(block or session.plan.blocks)[0].role


def probe_problems(form: Form, kept: Mapping[str, str]) -> dict[str, str]:
    """Marks that are no cell of the board."""
    if form.kind != "probe":
        return {}
    return {key: "Please mark one square." for key, value in kept.items() if value and not is_cell(value)}


def is_cell(value: str, size: int = 9) -> bool:
    parts = value.split(",")
    return len(parts) == 2 and all(part.isdecimal() and int(part) < size for part in parts)


def rows_of(
    lab: Lab,
    participant: ParticipantRow,
    form: Form,
    kept: Mapping[str, str],
    right: Mapping[str, Question],
    timings: Mapping[str, ItemTiming],
) -> list[AnswerRow]:
    now_utc = lab.now_utc()
    rows = []
    for item in form.items:
        timing, value = timings.get(item.key, UNTIMED), kept[item.key]
        correct = right[item.key].is_right(value) if item.key in right else None
        rows.append(
            AnswerRow(
                participant.id,
                form.name,
                form.attempt,
                item.key,
                value,
                correct,
                timing.first_ms,
                timing.last_ms,
                timing.changes,
                now_utc,
            )
        )
    return rows


def go_on(db: DbSession, lab: Lab, session: Session, form: Form, all_right: bool) -> None:
    """What handing in a form leads to."""
    if form.kind == "attention":
        participants.seen(db, session.participant.id, lab.now_utc())
    elif form.kind == "quiz" and not all_right:
        if form.tries_left == 0:
            journey.happen(db, lab, session, Event.QUIZ_FAILED, PARTICIPANT)
        else:
            participants.seen(db, session.participant.id, lab.now_utc())
    elif form.kind == "questionnaire" and due_form(db, session) is not None:
        participants.seen(db, session.participant.id, lab.now_utc())
    else:
        pages.turn(db, lab, session)
