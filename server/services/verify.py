"""Verify: execute everything that is stored again and name the first difference of every trial.

One snapshot, one participant in memory at a time.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from server.domain import canonical
from server.domain.errors import NotFoundError
from server.services import person_check, trial_check
from server.services.lab import Lab
from server.services.session import Session, session_of
from server.services.trial_check import Audit
from server.storage import events, orphans, participants, studies, trials
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
        if study_id is None:
            report.differences += strays(db)
    return report


def version_differences(db: DbSession, study_id: int | None) -> Iterator[str]:
    """A launched version is immutable: its text and its hash belong together, and versions count from 1."""
    for row in studies.every(db):
        versions = studies.versions(db, row.id) if study_id in {None, row.id} else []
        for number, version in enumerate(versions, start=1):
            if version.number != number:
                yield f"study {row.slug} version {version.number}: is launch number {number}"
            if canonical.sha256(version.definition) != version.sha256:
                yield f"study {row.slug} version {version.number}: definition was changed after its launch"


def check_participant(db: DbSession, lab: Lab, participant: ParticipantRow, report: Report) -> None:
    report.participants += 1
    rows = trials.of_participant(db, participant.id)
    found: list[str] = []
    try:
        session = session_of(db, lab, participant)
        found += check_trials(db, lab, session, rows, report)
        named = {line.split()[0] for line in found}
        about = person_check.check(db, lab, session, rows)
        found += [line for line in about if line.split()[0] not in named]
    except Exception as error:  # noqa: BLE001 (a row may hold anything; the others are still to be checked)
        found.append(f"{participant.id} cannot be checked: {trial_check.said_of(error)}")
    report.differences += found


def check_trials(
    db: DbSession, lab: Lab, session: Session, rows: Sequence[TrialRow], report: Report
) -> Iterator[str]:
    for row in rows:
        stored = events.of_trial(db, row.id)
        report.trials += 1
        report.events += len(stored)
        if found := trial_check.check(lab, session, row, stored, report.audit):
            yield found


def strays(db: DbSession) -> Iterator[str]:
    """Rows that belong to nobody, which no database lets in unless its foreign keys are switched off."""
    for trial_id in orphans.trials(db):
        yield f"{trial_id} is a trial of nobody"
    for trial_id in orphans.events(db):
        yield f"{trial_id} has events, but is no trial"
