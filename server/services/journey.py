"""Moving a participant along: the one place that writes a status, by the table of `domain.participation`."""

from collections.abc import Sequence

from server.domain import participation
from server.domain.participation import ACTIVE, WENT_THROUGH, Event, State
from server.domain.plan import COMPLETE, page_kind
from server.domain.study import StudyDefinition
from server.services.lab import Lab
from server.services.session import Session
from server.storage import answers, journeys, participants, trials
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow
from server.storage.trials import TrialRow

PARTICIPANT, SERVER = "participant", "server"
LEFT_BY: dict[str, Event] = {
    "instructions": Event.READ,
    "practice": Event.PRACTICE_OVER,
    "quiz": Event.QUIZ_PASSED,
}
"""What turning from a page means, where it does not depend on the block."""


def state(db: DbSession, session: Session) -> State:
    """Where the participant stands."""
    return standing(session, trials.of_participant(db, session.participant.id))


def standing(session: Session, rows: Sequence[TrialRow]) -> State:
    """The same, from the participant's trials."""
    participant = session.participant
    if participant.status != ACTIVE:
        return State(participant.status)
    _, block = page_kind(participant.page)
    begun = any(r.block == block and r.phase == "main" and r.outcome is not None for r in rows)
    return participation.stage_of(participant.page, last_block=block == session.plan.blocks, begun=begun)


def happen(db: DbSession, lab: Lab, session: Session, event: Event, source: str = SERVER) -> State:
    """Let `event` happen to the participant, whose row the caller holds; what does not move is not kept."""
    before = state(db, session)
    after = participation.after(before, event)
    if after == before:
        return before
    participant, now_utc = session.participant, lab.now_utc()
    if event is Event.TOOK_AGAIN:
        participants.resume(db, participant.id, now_utc)
        after = state(db, Session(participant._replace(status=ACTIVE), session.study, session.plan))
    elif after in participation.ENDS:
        through = after in WENT_THROUGH
        page = COMPLETE if through else participant.page
        code = code_of(session.study, after)
        participants.end(db, participant.id, after.value, page, code, now_utc if through else None, now_utc)
    journeys.add(db, participant.id, event.value, after.value, source, now_utc)
    return after


def turned(db: DbSession, lab: Lab, session: Session, page: str) -> None:
    """Turn to `page`, which is not the last one, and keep what that meant."""
    participant = session.participant
    kind, block = page_kind(participant.page)
    event = LEFT_BY.get(kind)
    if event is None and page_kind(page)[1] != block:  # play, survey: a block is behind
        event = Event.ROUNDS_OVER if block == session.plan.blocks else Event.BLOCK_OVER
    now_utc = lab.now_utc()
    participants.turn_page(db, participant.id, page, now_utc)
    if event is not None and block:
        moved = Session(participant._replace(page=page), session.study, session.plan)
        journeys.add(db, participant.id, event.value, state(db, moved).value, PARTICIPANT, now_utc)


def finish(db: DbSession, lab: Lab, session: Session) -> State:
    """The end of who went through everything: finished, unless the study's rule excludes the data."""
    inattentive = is_inattentive(db, session.study, session.participant)
    event = Event.ALL_ANSWERED_INATTENTIVE if inattentive else Event.ALL_ANSWERED
    last = session.plan.pages[-2]  # a study without last questions ends on its last block's page
    surveyed = session.participant._replace(page=last if page_kind(last)[1] == 0 else "survey:0")
    return happen(db, lab, Session(surveyed, session.study, session.plan), event, PARTICIPANT)


def is_inattentive(db: DbSession, study: StudyDefinition, participant: ParticipantRow) -> bool:
    """The rule that was frozen with the study: so many failed checks, and the data are excluded."""
    return answers.wrong(db, participant.id, "attention:") >= study.attention_failures


def code_of(study: StudyDefinition, state: State) -> str | None:
    """What somebody who came to this end hands in; None where there is nothing to hand in."""
    codes = {
        State.FINISHED: study.completion_code,
        State.FAILED: study.codes.failed or study.completion_code,
        State.SCREENED_OUT: study.codes.screened_out,
        State.WITHDRAWN: study.codes.withdrawn,
    }
    return codes.get(state) or None
