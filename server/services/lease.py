"""Holding a place: who was not seen for longer than the study's lease may come back while one is free."""

from server.domain import canonical, plan
from server.domain.participation import ACTIVE, Event
from server.services import journey
from server.services.lab import Lab
from server.services.session import definition_of, session_of
from server.storage import participants, studies
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow


def keeps(db: DbSession, lab: Lab, participant: ParticipantRow) -> bool:
    """Whether the participant may go on; whoever comes too late for a place that was taken is timed out."""
    if participant.status != ACTIVE:
        return False
    return not has_lapsed(db, lab, participant) or claim(db, lab, participant)


def has_lapsed(db: DbSession, lab: Lab, participant: ParticipantRow) -> bool:
    study = definition_of(db, lab, participant.study_version_id)
    began_utc = canonical.minutes_before(lab.now(), study.lease_min)
    return plan.has_left(participant.status, participant.last_seen_utc, began_utc)


def claim(db: DbSession, lab: Lab, participant: ParticipantRow) -> bool:
    """Take the place again if the arm has a free one, else time out. Nobody enrols meanwhile."""
    studies.hold(db, participant.study_id)
    participant = participants.hold(db, participant.id)
    if participant.status != ACTIVE:
        return False
    if not has_lapsed(db, lab, participant):
        return True  # another tab was faster
    if is_free(db, lab, participant):
        participants.seen(db, participant.id, lab.now_utc())
        return True
    journey.happen(db, lab, session_of(db, lab, participant), Event.PLACE_LOST)
    return False


def is_free(db: DbSession, lab: Lab, participant: ParticipantRow) -> bool:
    """Whether the participant's arm has a place that nobody holds."""
    study = definition_of(db, lab, participant.study_version_id)
    leases = began(db, lab, participant.study_id)
    cells = participants.holding_places(db, participant.study_id, participant.mode, leases)
    held = sum(cell.people for cell in cells if cell.arm == participant.arm)
    return held < study.arm(participant.arm).places


def began(db: DbSession, lab: Lab, study_id: int) -> dict[int, str]:
    """By version of a study since when somebody who holds a place must have been seen.

    Each person keeps the lease of the version that they agreed to, whatever a later one says.
    """
    now = lab.now()
    versions = [row.id for row in studies.versions(db, study_id)]
    return {key: canonical.minutes_before(now, definition_of(db, lab, key).lease_min) for key in versions}
