"""Which page a participant is on, and when it turns.

A completion code exists only once nothing is missing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Literal

from server.domain import canonical, events, plan
from server.domain.errors import CorruptError
from server.domain.forms import Form
from server.domain.money import bonus_minor
from server.domain.participation import ACTIVE, State
from server.domain.plan import COMPLETE, ROUNDS, page_kind
from server.domain.study import Role, StudyDefinition
from server.services import journey, probe
from server.services.due import due_form
from server.services.lab import Lab
from server.services.session import Session, session_of
from server.storage import answers, enrolments, participants, trials
from server.storage import events as event_rows
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow
from server.storage.trials import TrialRow

WON = frozenset({"found", "arrived"})
"""Outcomes of a round that count as a success."""

Kind = Literal["instructions", "play", "form", "end"]


@dataclass(frozen=True, slots=True)
class Progress:
    """How far somebody is; times run from consent."""

    rounds_over: int
    """Main rounds of the session that have ended."""
    rounds: int
    minutes: int
    won: int
    bonus_minor: int


@dataclass(frozen=True, slots=True)
class Page:
    """The page of a participant's present state, with all that its template shows.

    `block`, `role` and what follows from them are those of the last block on pages after it. `form` is there
    where `kind` is `form`.
    """

    kind: Kind
    name: str
    """Goes back as `from_page` when the participant goes on."""
    state: State
    study: StudyDefinition
    role: Role
    block: int
    blocks: int
    practice: bool
    """Only practice rounds are played on this page."""
    form: Form | None
    signs: Mapping[str, Any] | None
    """What the probe draws; None on every other page."""
    progress: Progress
    code: str | None
    """To hand in, once an end was reached."""
    data_kept: bool
    marketplace: str
    parameters: Mapping[str, str]


def page_of(db: DbSession, lab: Lab, participant: ParticipantRow) -> Page:
    session = session_of(db, lab, participant)
    kind, block = page_kind(participant.page)
    form = due_form(db, session) if participant.status == ACTIVE else None
    block = block or session.plan.blocks
    rows = trials.of_participant(db, participant.id)
    return Page(
        kind=shown_as(participant, form),
        name=participant.page,
        state=journey.standing(session, rows),
        study=session.study,
        role=session.plan.of_block(block)[0].role,
        block=block,
        blocks=session.plan.blocks,
        practice=kind == "practice",
        form=form,
        signs=probe.drawing(lab, session) if form is not None and form.kind == "probe" else None,
        progress=progress_of(lab, session, rows),
        code=participant.completion_code,
        data_kept=participant.erased_utc is None,
        marketplace=participant.marketplace,
        parameters=canonical.loads(enrolments.identity_of(db, participant.id).parameters),
    )


def shown_as(participant: ParticipantRow, form: Form | None) -> Kind:
    """Which of the templates shows the page."""
    if participant.status != ACTIVE:
        return "end"
    if form is not None:
        return "form"
    return "play" if page_kind(participant.page)[0] in ROUNDS else "instructions"


def progress_of(lab: Lab, session: Session, rows: Sequence[TrialRow]) -> Progress:
    main = [row for row in rows if row.phase == "main" and row.outcome is not None]
    won = sum(row.outcome in WON for row in main)
    began = canonical.utc_moment(session.participant.consented_utc)
    ended = session.participant.finished_utc
    until = canonical.utc_moment(ended) if ended else lab.now()
    return Progress(
        rounds_over=len(main),
        rounds=session.study.main_rounds,
        minutes=max(0, (until - began) // timedelta(minutes=1)),
        won=won,
        bonus_minor=bonus_minor(session.study.pay, won),
    )


def advance(db: DbSession, lab: Lab, participant: ParticipantRow, from_page: str) -> None:
    """Go on from a page that asks for nothing else. Whoever is elsewhere by now stays there."""
    session = session_of(db, lab, participant)
    kind, _ = page_kind(participant.page)
    if from_page != participant.page or participant.status != ACTIVE:
        return
    if kind not in {"instructions", *ROUNDS} or not page_is_through(db, session):
        return
    if due_form(db, session) is not None:
        return  # whoever went past a check could never hand it in, and would never get a code
    turn(db, lab, session)


def page_is_through(db: DbSession, session: Session) -> bool:
    ended = {t.round for t in trials.of_participant(db, session.participant.id) if t.outcome is not None}
    return all(planned.round in ended for planned in session.plan.of_page(session.participant.page))


def turn(db: DbSession, lab: Lab, session: Session) -> None:
    """Turn from the page in `session` to the next one, unless another tab has done so."""
    before = session.participant
    held = participants.hold(db, before.id)
    if (held.page, held.status) != (before.page, ACTIVE):
        return
    page = session.plan.page_after(before.page)
    if page == COMPLETE:
        check_complete(db, session)
        journey.finish(db, lab, session)
    else:
        journey.turned(db, lab, session, page)


def check_complete(db: DbSession, session: Session) -> None:
    """See to it that every round has ended, that its events are all there, and every form.

    Raises:
        CorruptError: something is missing.
    """
    rows = trials.of_participant(db, session.participant.id)
    if absent := plan.missing(session.plan, [(row.round, row.outcome) for row in rows]):
        raise CorruptError(f"rounds {absent} of {session.participant.id} have not ended")
    handed_in = answers.attempts(db, session.participant.id)
    if open_forms := [name for name in plan.forms_of(session.study, session.plan) if name not in handed_in]:
        raise CorruptError(f"forms {open_forms} of {session.participant.id} were not handed in")
    for row in rows:
        check_chain(db, row)


def check_chain(db: DbSession, row: TrialRow) -> None:
    digest = ""
    stored = event_rows.of_trial(db, row.id)
    for event in stored:
        digest = events.digest(digest, event.body)
    if [event.seq for event in stored] != list(range(row.last_seq + 1)) or digest != row.digest:
        raise CorruptError(f"events of {row.id} are missing or changed: run `hatlab verify`")
