"""Playing: open a round, take a step. A worker keeps nothing that it cannot rebuild from the log.

A step is read log -> fold -> the person acts and the teammates decide -> insert -> answer. The answer is
computed before the write lock is taken; the primary key (trial_id, seq) decides between two writers. Whatever
is shown has been stored.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from server.domain import canonical, events, trial
from server.domain.errors import BadInputError, ClosedError, NotFoundError, StaleError
from server.domain.participation import ACTIVE
from server.domain.plan import Round
from server.domain.view import Heard, Place, View, roads, saw, view_for
from server.services import fold, lease, pages
from server.services.due import due_form
from server.services.fold import Running
from server.services.lab import Lab
from server.services.session import Session, place_of, session_of, spec_of
from server.storage import events as event_rows
from server.storage import participants, trials
from server.storage.database import DbSession
from server.storage.events import EventRow
from server.storage.participants import ParticipantRow
from server.storage.trials import TrialRow

SEEN_EVERY_MIN = 0.5  # how exactly `last_seen_utc` is kept; leases are minutes


@dataclass(frozen=True, slots=True)
class PageChange:
    """There is no round to play on this page any more: load the participant's page again."""


@dataclass(frozen=True, slots=True)
class Kept:
    """What the cache holds for (trial id, digest of the last event)."""

    running: Running
    heard: Heard
    place: Place


def open_round(db: DbSession, lab: Lab, participant: ParticipantRow, after: int | None) -> View | PageChange:
    """The round in hand, or the one after round `after`, which has ended; begins it if need be.

    A round that is over stays in hand until the one after it is asked for, so that a reload shows its end
    again. After the last round of a page the page turns; an attention check that is due comes first.
    """
    session = session_of(db, lab, participant)
    rounds = session.plan.of_page(participant.page)
    if not rounds or not lease.keeps(db, lab, participant):
        return PageChange()
    newest = trials.newest(db, participant.id)
    wanted = wanted_round(rounds, newest, after)
    in_hand = wanted is not None and newest is not None and newest.round == wanted.round
    if not in_hand and due_form(db, session) is not None:
        return PageChange()
    if wanted is None:
        pages.turn(db, lab, session)
        return PageChange()
    row = newest if newest and in_hand else begin_round(db, lab, session, wanted)
    if row is None:
        return PageChange()
    kept = current(db, lab, row)
    keep_seen(db, lab, participant)
    return {**shown(kept, row.last_seq), "roads": roads(kept.running.trial)}


def wanted_round(rounds: Sequence[Round], newest: TrialRow | None, after: int | None) -> Round | None:
    """Which round of a page is due; None once all are through."""
    if newest is None or newest.round < rounds[0].round:
        return rounds[0]
    goes_on = newest.outcome is not None and after is not None and after >= newest.round
    due = newest.round + 1 if goes_on else newest.round
    return next((planned for planned in rounds if planned.round == due), None)


def begin_round(db: DbSession, lab: Lab, session: Session, planned: Round) -> TrialRow | None:
    """Store event 0 of a new trial, or find that another tab has just done so.

    None: meanwhile the participant came to an end or turned the page, and nothing of them may be stored here.
    """
    participant = session.participant
    spec = spec_of(lab, session, planned)
    running, said = fold.begin(lab, spec)
    running = replace(running, trial=trial.spoken(running.trial, said))
    heard, now_utc = running.heard, lab.now_utc()
    trial_id = f"{participant.id}-{planned.round:03d}"
    start = events.start_body(trial_id, participant.mode, spec, said, saw(running.trial, heard), now_utc)
    body = canonical.dumps(start)
    row = TrialRow(
        id=trial_id,
        participant_id=participant.id,
        round=planned.round,
        phase=planned.phase,
        block=planned.block,
        role=planned.role,
        number=planned.number,
        situation=planned.situation,
        arm=participant.arm,
        bundle=spec.bundle.name if spec.bundle else None,
        bundle_sha256=spec.bundle.sha256 if spec.bundle else None,
        seed=planned.seed,
        last_seq=0,
        digest=events.digest("", body),
        outcome=None,
        steps=0,
        progress=0,
        started_utc=now_utc,
        ended_utc=None,
    )
    held = participants.hold(db, participant.id)
    if (held.page, held.status) != (participant.page, ACTIVE):
        return None
    if there := trials.of_round(db, participant.id, planned.round):
        return there
    trials.add(db, row)
    event_rows.append(db, EventRow(row.id, 0, body, row.digest, now_utc))
    lab.cache.put((row.id, row.digest), Kept(running, heard, place_of(planned)))
    return row


def decide(
    db: DbSession,
    lab: Lab,
    participant: ParticipantRow,
    round: int,  # noqa: A002 (the word of the play API)
    seq: int,
    action: int,
    timing: Mapping[str, Any],
) -> View:
    """Take step `seq` of a round. The same step again gets the same answer again.

    Raises:
        NotFoundError: the round has not been begun.
        BadInputError: the action is not on offer, or the timing cannot be.
        StaleError: another decision has this seq, or its turn has not come; carries the current view.
        ClosedError: the participant's session is over.
    """
    events.check_timing(timing)
    if not lease.keeps(db, lab, participant):
        raise ClosedError("this session is over; load its page again to see what to do")
    row = trials.of_round(db, participant.id, round)
    if row is None:
        raise NotFoundError(f"round {round} has not been opened")
    if seq != row.last_seq + 1 or row.outcome is not None:
        return answered(db, lab, row, seq, action, timing)
    kept = current(db, lab, row)
    if not kept.running.trial.can(action):
        raise BadInputError(f"action: {action} is not on offer")
    after, event, kept = step(lab, row, kept, action, timing)
    if not event_rows.append(db, event):
        newest = trials.of_round(db, participant.id, round)
        assert newest is not None
        return answered(db, lab, newest, seq, action, timing)
    trials.moved_on(db, after)
    keep_seen(db, lab, participant)
    lab.cache.drop((row.id, row.digest))  # or the cache would hold steps, and not as many trials as it can
    lab.cache.put((after.id, after.digest), kept)
    return shown(kept, seq)


def step(
    lab: Lab, row: TrialRow, kept: Kept, action: int, timing: Mapping[str, Any]
) -> tuple[TrialRow, EventRow, Kept]:
    """What a decision makes of a trial: its row, the new event, and the trial in memory. Writes nothing."""
    running, moves, token = fold.play(kept.running, action)
    heard, now_utc = running.heard, lab.now_utc()
    seen = saw(running.trial, heard)
    body = canonical.dumps(events.decision_body(action, token, timing, moves, seen, now_utc))
    digest = events.digest(row.digest, body)
    after = row._replace(
        last_seq=row.last_seq + 1,
        digest=digest,
        outcome=running.trial.outcome,
        steps=running.trial.step,
        progress=running.trial.progress,
        ended_utc=now_utc if running.trial.over else None,
    )
    event = EventRow(row.id, after.last_seq, body, digest, now_utc)
    return after, event, Kept(running, heard, kept.place)


def answered(
    db: DbSession, lab: Lab, row: TrialRow, seq: int, action: int, timing: Mapping[str, Any]
) -> View:
    """The answer to a step that is not the next one.

    Raises:
        StaleError: unless it is a stored step, sent again.
    """
    stored = event_rows.one(db, row.id, seq) if 1 <= seq <= row.last_seq else None
    if stored is not None and events.same_answer(canonical.loads(stored.body), action, timing):
        then = row._replace(last_seq=seq, digest=stored.digest)
        return shown(current(db, lab, then), seq)
    why = "was answered otherwise" if stored is not None else "is not the step that is due"
    raise StaleError(f"step {seq} {why}", shown(current(db, lab, row), row.last_seq))


def current(db: DbSession, lab: Lab, row: TrialRow) -> Kept:
    """The trial as of the row's last event: from the cache, or folded from the log."""
    key = (row.id, row.digest)
    kept: Kept | None = lab.cache.get(key)
    if kept is None:
        bodies = [canonical.loads(e.body) for e in event_rows.of_trial(db, row.id, row.last_seq)]
        session = session_of(db, lab, participants.by_id(db, row.participant_id))
        running = fold.fold(lab, bodies)
        kept = Kept(running, running.heard, place_of(session.plan.rounds[row.round - 1]))
        lab.cache.put(key, kept)
    return kept


def shown(kept: Kept, seq: int) -> View:
    return view_for(kept.running.trial, kept.heard, kept.place, seq)


def keep_seen(db: DbSession, lab: Lab, participant: ParticipantRow) -> None:
    """Keep the lease alive, without a write for every step."""
    if participant.last_seen_utc < canonical.minutes_before(lab.now(), SEEN_EVERY_MIN):
        participants.seen(db, participant.id, lab.now_utc())
