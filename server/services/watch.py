"""Keeping what happened to a participant's window: focus, visibility, size, full screen."""

from collections.abc import Sequence

from server.domain.participation import ACTIVE
from server.services.lab import Lab
from server.storage import browser_log, participants
from server.storage.browser_log import BrowserEventRow
from server.storage.database import DbSession
from server.storage.participants import ParticipantRow

MOST_A_VISIT = 2_000
"""A page that reports more is broken or hostile; what comes after is not kept."""
MOST_A_PERSON = 20_000
"""Of all visits together: the name of a visit is the browser's own, and it may draw as many as it likes."""

Happened = tuple[int, str, str, float]
"""Ordinal within the visit, kind, value, ms since the page was loaded."""


def keep(
    db: DbSession,
    lab: Lab,
    participant: ParticipantRow,
    visit: str,
    page: str,
    happened: Sequence[Happened],
) -> int:
    """Store the events that are new; how many those were. After the end nothing is kept."""
    if participant.status != ACTIVE or participants.hold(db, participant.id).status != ACTIVE:
        return 0
    room = MOST_A_PERSON - browser_log.count(db, participant.id)
    now_utc = lab.now_utc()
    rows = [
        BrowserEventRow(participant.id, visit, seq, page, kind, value, at_ms, now_utc)
        for seq, kind, value, at_ms in happened
        if seq < MOST_A_VISIT
    ]
    return browser_log.add(db, rows[: max(0, room)])
