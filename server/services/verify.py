"""Verify: execute everything that is stored again and name the first difference of every trial.

One snapshot, one participant in memory at a time.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

from server.domain import allocation, canonical, participation
from server.domain.errors import HatlabError, NotFoundError
from server.services import trial_check
from server.services.lab import Lab
from server.services.session import Session, session_of
from server.services.trial_check import Audit
from server.storage import enrolments, events, participants, studies, trials
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow
from server.storage.trials import TrialRow

SHOWN_MAX = 50


@dataclass
class Report:
    participants: int = 0
    trials: int = 0
    events: int = 0
    differences: list[str] = field(default_factory=list)
    """One line for each bad trial (or participant), which it begins with."""
    audit: Audit | None = None

    @property
    def clean(self) -> bool:
        return not self.differences

    @property
    def text(self) -> str:
        lines = self.differences[:SHOWN_MAX]
        if len(self.differences) > SHOWN_MAX:
            lines.append(f"… and {len(self.differences) - SHOWN_MAX} more")
        result = f"{len(self.differences)} differences" if self.differences else "all as stored"
        lines.append(
            f"verified {self.participants} participants, {self.trials} trials, {self.events} events: {result}"
        )
        if self.audit is not None:
            lines.append(
                f"audit: {self.audit.otherwise} of {self.audit.decided} decisions came out otherwise"
            )
        return "\n".join(lines)


def verify(lab: Lab, study: str | None = None, audit: bool = False) -> Report:
    """Verify one study, or everything.

    Raises:
        NotFoundError: no such study.
    """
    report = Report(audit=Audit() if audit else None)
    with lab.database.reading() as db:
        study_id = None
        if study is not None:
            row = studies.by_slug(db, study)
            if row is None:
                raise NotFoundError(f"there is no study {study}")
            study_id = row.id
        report.differences += version_differences(db, study_id)
        for participant in participants.stream(db, study_id):
            check_participant(db, lab, participant, report)
    return report


def version_differences(db: DbSession, study_id: int | None) -> Iterator[str]:
    """A launched version is immutable: its text and its hash belong together."""
    for row in studies.every(db):
        for version in studies.versions(db, row.id) if study_id in {None, row.id} else ():
            if canonical.sha256(version.definition) != version.sha256:
                yield f"study {row.slug} version {version.number}: definition was changed after its launch"


def check_participant(db: DbSession, lab: Lab, participant: ParticipantRow, report: Report) -> None:
    report.participants += 1
    rows = trials.of_participant(db, participant.id)
    try:
        session = session_of(db, lab, participant)
    except (HatlabError, ValueError) as error:
        report.differences.append(f"{participant.id} {error}")
        return
    report.differences += [f"{participant.id} {line}" for line in participant_differences(db, session, rows)]
    for row in rows:
        stored = events.of_trial(db, row.id)
        report.trials += 1
        report.events += len(stored)
        if found := trial_check.check(lab, session, row, stored, report.audit):
            report.differences.append(found)


def participant_differences(db: DbSession, session: Session, rows: list[TrialRow]) -> Iterator[str]:
    """The draw of the arm, done again; and a code only for whoever has played everything."""
    participant, drawn = session.participant, enrolments.allocation_of(db, session.participant.id)
    counts = {tuple(cell): people for *cell, people in canonical.loads(drawn.counts)}
    places = {arm.name: arm.places for arm in session.study.arms}
    again = allocation.allocate(places, session.study.role_orders, participant.device, counts, drawn.seed)
    if again is None or (again.arm, again.role_order) != (participant.arm, participant.role_order):
        yield f"allocation: stored {participant.arm}, {participant.role_order}; the draw gives {again}"
    elif again.probability != drawn.probability:
        yield f"allocation.probability stored {drawn.probability}, replay {again.probability}"
    if participant.completion_code is not None:
        ended = [(row.round, row.outcome) for row in rows]
        if absent := participation.missing(session.plan, ended):
            yield f"has a completion code, but rounds {absent} have not ended"
