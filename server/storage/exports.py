"""What an export reads: a study's people a page at a time, their trials and events, each in order of its key.

Keyset pages keep memory constant and need no sort over the whole study. Nothing here touches `identity`.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, cast

from sqlalchemy import func, select

from server.storage.answers import AnswerRow
from server.storage.browser_log import BrowserEventRow
from server.storage.database import DbSession
from server.storage.journeys import JourneyRow
from server.storage.tables import (
    allocation,
    answer,
    browser_event,
    consent,
    event,
    journey,
    participant,
    study,
    study_version,
    trial,
)

Row = Mapping[str, Any]
Event = tuple[str, int, str, str]
ROWS_A_FETCH = 2_000


def study_row(db: DbSession, slug: str) -> Row | None:
    statement = select(study.c.id, study.c.slug, study.c.title).where(study.c.slug == slug)
    return next((dict(row) for row in db.read(statement).mappings()), None)


def version_rows(db: DbSession, study_id: int) -> list[Row]:
    """Every launched version, oldest first, with its definition as text."""
    columns = (
        study_version.c.id,
        study_version.c.number,
        study_version.c.sha256,
        study_version.c.launched_utc,
        study_version.c.definition,
    )
    statement = select(*columns).where(study_version.c.study_id == study_id).order_by(study_version.c.number)
    return [dict(row) for row in db.read(statement).mappings()]


def participant_page(db: DbSession, study_id: int, modes: Sequence[str], after: str, limit: int) -> list[Row]:
    """The next people of a study, by id, with their version, consent and allocation."""
    statement = (
        select(
            participant,
            study_version.c.number.label("study_version"),
            consent.c.version.label("consent_version"),
            consent.c.text_sha256.label("consent_text_sha256"),
            allocation.c.probability.label("allocation_probability"),
            allocation.c.seed.label("allocation_seed"),
            allocation.c.allocated_utc,
        )
        .join(study_version, study_version.c.id == participant.c.study_version_id)
        .outerjoin(consent, consent.c.participant_id == participant.c.id)
        .outerjoin(allocation, allocation.c.participant_id == participant.c.id)
        .where(participant.c.study_id == study_id, participant.c.mode.in_(modes), participant.c.id > after)
        .order_by(participant.c.id)
        .limit(limit)
    )
    return [dict(row) for row in db.read(statement).mappings()]


def trial_rows(db: DbSession, participants: Sequence[str], phases: Sequence[str]) -> list[Row]:
    """The trials of these people, by id."""
    statement = (
        select(trial)
        .where(trial.c.participant_id.in_(participants), trial.c.phase.in_(phases))
        .order_by(trial.c.id)
    )
    return [dict(row) for row in db.read(statement).mappings()]


def event_rows(db: DbSession, participants: Sequence[str], phases: Sequence[str]) -> Iterator[Event]:
    """The events of these trials, by trial and seq, streamed: trial id, seq, body and time of storing."""
    statement = (
        select(event.c.trial_id, event.c.seq, event.c.body, event.c.stored_utc)
        .join(trial, trial.c.id == event.c.trial_id)
        .where(trial.c.participant_id.in_(participants), trial.c.phase.in_(phases))
        .order_by(event.c.trial_id, event.c.seq)
        .execution_options(yield_per=ROWS_A_FETCH)
    )
    yield from cast("Iterator[Event]", db.read(statement))


def won(db: DbSession, participants: Sequence[str], outcomes: Collection[str]) -> dict[str, int]:
    """How many main rounds each of these people has won; who won none is not there."""
    statement = (
        select(trial.c.participant_id, func.count())
        .where(trial.c.participant_id.in_(participants), trial.c.phase == "main")
        .where(trial.c.outcome.in_(outcomes))
        .group_by(trial.c.participant_id)
    )
    return dict(cast("list[tuple[str, int]]", [tuple(row) for row in db.read(statement)]))


def bundles_played(db: DbSession, participants: Sequence[str]) -> dict[str, set[str]]:
    """The sha256 of every agent that each of these people played with."""
    statement = (
        select(trial.c.participant_id, trial.c.bundle_sha256)
        .where(trial.c.participant_id.in_(participants), trial.c.bundle_sha256.is_not(None))
        .distinct()
    )
    found: dict[str, set[str]] = {}
    for who, sha256 in cast("Iterator[tuple[str, str]]", db.read(statement)):
        found.setdefault(who, set()).add(sha256)
    return found


def attention_failed(db: DbSession, participants: Sequence[str]) -> dict[str, int]:
    """How many attention checks each of these people has failed; who failed none is not there."""
    statement = (
        select(answer.c.participant_id, func.count(answer.c.form.distinct()))
        .where(answer.c.participant_id.in_(participants), answer.c.correct.is_(False))
        .where(answer.c.form.startswith("attention:", autoescape=True))
        .group_by(answer.c.participant_id)
    )
    return dict(cast("list[tuple[str, int]]", [tuple(row) for row in db.read(statement)]))


def answer_rows(db: DbSession, participants: Sequence[str]) -> list[AnswerRow]:
    """Everything that these people answered, in no order."""
    statement = select(answer).where(answer.c.participant_id.in_(participants))
    return [AnswerRow._make(row) for row in db.read(statement)]


def browser_event_rows(db: DbSession, participants: Sequence[str]) -> Iterator[BrowserEventRow]:
    """What the browsers of these people told, by participant, visit and seq, streamed."""
    key = (browser_event.c.participant_id, browser_event.c.visit, browser_event.c.seq)
    statement = (
        select(browser_event)
        .where(browser_event.c.participant_id.in_(participants))
        .order_by(*key)
        .execution_options(yield_per=ROWS_A_FETCH)
    )
    yield from map(BrowserEventRow._make, db.read(statement))


def journey_rows(db: DbSession, participants: Sequence[str]) -> list[JourneyRow]:
    """What happened to these people, by participant and seq."""
    statement = (
        select(journey)
        .where(journey.c.participant_id.in_(participants))
        .order_by(journey.c.participant_id, journey.c.seq)
    )
    return [JourneyRow._make(row) for row in db.read(statement)]
