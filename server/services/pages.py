"""Which page a participant is on, and when it turns.

A completion code exists only once nothing is missing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from server.domain import canonical, events, participation
from server.domain.errors import CorruptError
from server.domain.participation import COMPLETE, page_kind
from server.domain.study import Role, StudyDefinition
from server.services.lab import Lab
from server.services.session import Session, session_of
from server.storage import enrolments, participants, trials
from server.storage import events as event_rows
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow
from server.storage.trials import TrialRow


@dataclass(frozen=True, slots=True)
class Page:
    """The page of a participant's present state, with all that its template shows.

    `block`, `role` and what follows from them are those of the last block on the page `complete`.
    """

    kind: Literal["instructions", "play", "complete"]
    name: str
    """Goes back as `from_page` when the participant goes on."""
    study: StudyDefinition
    role: Role
    block: int
    blocks: int
    rounds: int
    """Main rounds of the block."""
    practice_rounds: int
    limit: int
    rounds_stored: int
    """Main rounds of the session that have ended."""
    rounds_total: int
    completion_code: str | None
    marketplace: str
    parameters: Mapping[str, str]


def page_of(db: DbSession, lab: Lab, participant: ParticipantRow) -> Page:
    session = session_of(db, lab, participant)
    kind, block = page_kind(participant.page)
    block = block or session.plan.blocks
    main = [r for r in session.plan.rounds if r.phase == "main"]
    ended = {t.round for t in trials.of_participant(db, participant.id) if t.outcome is not None}
    return Page(
        kind=kind,
        name=participant.page,
        study=session.study,
        role=session.plan.of_block(block)[0].role,
        block=block,
        blocks=session.plan.blocks,
        rounds=session.study.trials_per_block,
        practice_rounds=session.study.practice_rounds,
        limit=session.study.step_limit,
        rounds_stored=sum(r.round in ended for r in main),
        rounds_total=len(main),
        completion_code=participant.completion_code,
        marketplace=participant.marketplace,
        parameters=canonical.loads(enrolments.identity_of(db, participant.id).parameters),
    )


def advance(db: DbSession, lab: Lab, participant: ParticipantRow, from_page: str) -> None:
    """Go on from a page that asks for nothing else. Whoever is elsewhere by now stays there."""
    session = session_of(db, lab, participant)
    kind, block = page_kind(participant.page)
    if from_page != participant.page or kind == "complete":
        return
    if kind == "play" and not block_is_through(db, session, block):
        return
    turn(db, lab, session)


def block_is_through(db: DbSession, session: Session, block: int) -> bool:
    ended = {t.round for t in trials.of_participant(db, session.participant.id) if t.outcome is not None}
    return all(planned.round in ended for planned in session.plan.of_block(block))


def turn(db: DbSession, lab: Lab, session: Session) -> None:
    """Turn from the page in `session` to the next one, unless another tab has done so."""
    before = session.participant.page
    if participants.hold(db, session.participant.id).page != before:
        return
    page = session.plan.page_after(before)
    if page == COMPLETE:
        check_complete(db, session)
        participants.finish(db, session.participant.id, page, session.study.completion_code, lab.now_utc())
    else:
        participants.turn_page(db, session.participant.id, page, lab.now_utc())


def check_complete(db: DbSession, session: Session) -> None:
    """See to it that every round has ended and that its events are all there.

    Raises:
        CorruptError: something is missing.
    """
    rows = trials.of_participant(db, session.participant.id)
    if absent := participation.missing(session.plan, [(row.round, row.outcome) for row in rows]):
        raise CorruptError(f"rounds {absent} of {session.participant.id} have not ended")
    for row in rows:
        check_chain(db, row)


def check_chain(db: DbSession, row: TrialRow) -> None:
    digest = ""
    stored = event_rows.of_trial(db, row.id)
    for event in stored:
        digest = events.digest(digest, event.body)
    if [event.seq for event in stored] != list(range(row.last_seq + 1)) or digest != row.digest:
        raise CorruptError(f"events of {row.id} are missing or changed: run `hatlab verify`")
