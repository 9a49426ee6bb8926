"""Rows of answers: to the quiz, to attention checks, to questionnaires and to the probe of the signs.

A form is named `<key>:<block>` (attention checks: `attention:<round>`); it is stored whole, once an attempt.
"""

from collections.abc import Sequence
from typing import NamedTuple

from sqlalchemy import func, insert, select
from sqlalchemy.exc import IntegrityError

from server.storage.database import DbSession
from server.storage.tables import answer


class AnswerRow(NamedTuple):
    participant_id: str
    form: str
    attempt: int
    item: str
    value: str
    correct: bool | None
    first_ms: float | None
    """From the moment the form was drawn to the first change of this answer."""
    last_ms: float | None
    changes: int | None
    stored_utc: str


def add(db: DbSession, rows: Sequence[AnswerRow]) -> bool:
    """Store a whole form; False if this attempt is there already."""
    db.hold()
    try:
        with db.connection.begin_nested():
            db.write(insert(answer), [row._asdict() for row in rows])
    except IntegrityError:
        return False
    return True


def of_participant(db: DbSession, participant_id: str) -> list[AnswerRow]:
    statement = select(answer).where(answer.c.participant_id == participant_id)
    ordered = statement.order_by(answer.c.stored_utc, answer.c.form, answer.c.attempt, answer.c.item)
    return [AnswerRow._make(row) for row in db.read(ordered)]


def attempts(db: DbSession, participant_id: str) -> dict[str, int]:
    """How often each form was handed in."""
    statement = (
        select(answer.c.form, func.max(answer.c.attempt))
        .where(answer.c.participant_id == participant_id)
        .group_by(answer.c.form)
    )
    rows: list[tuple[str, int]] = [tuple(row) for row in db.read(statement)]
    return dict(rows)


def wrong(db: DbSession, participant_id: str, form_prefix: str) -> int:
    """How many forms whose name begins so have a wrong answer."""
    statement = select(func.count(answer.c.form.distinct())).where(
        answer.c.participant_id == participant_id,
        answer.c.form.startswith(form_prefix, autoescape=True),
        answer.c.correct.is_(False),
    )
    return int(db.read(statement).scalar_one())
