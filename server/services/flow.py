"""Counting the flow of a study: who came to which stage, by mode and by arm. People and robots never mix."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from server.domain import canonical, flow
from server.domain.flow import ABANDONED, ERASED, Stage
from server.domain.study import from_json
from server.storage import erasure, headcounts, refusals, studies
from server.storage.database import DbSession
from server.storage.headcounts import Stand
from server.storage.studies import VersionRow

Counts = Mapping[Stage, int | None]
AWAY = "away"


@dataclass(frozen=True, slots=True)
class Flow:
    """One mode of a study: every stage of the whole, and of each arm those after consent."""

    mode: str
    whole: Counts
    arms: Mapping[str, Counts]


def flows(db: DbSession, study_id: int, now: datetime, modes: Sequence[str]) -> list[Flow]:
    """The flow of each mode, over all versions; the lease that each person agreed to tells who has left."""
    versions = studies.versions(db, study_id)
    arms = list(dict.fromkeys(arm.name for row in versions for arm in from_json(row.definition).arms))
    stands = list(stands_of(db, study_id, versions, now))
    found = []
    for mode in modes:
        gone = erasure.counted(db, study_id, mode)
        mine = [stand for stand in stands if stand.mode == mode]
        mine += [Stand(mode, *each) for each in gone if each.standing == ERASED]
        refused = Counter(refusals.counts(db, study_id, mode))
        refused.update({each.standing: each.people for each in gone if each.standing != ERASED})
        whole = flow.counted(by_standing(mine), refused)
        of_arms = {
            arm: flow.after_consent(by_standing([stand for stand in mine if stand.arm == arm]))
            for arm in arms
        }
        found.append(Flow(mode, whole, of_arms))
    return found


def stands_of(db: DbSession, study_id: int, versions: Sequence[VersionRow], now: datetime) -> Iterator[Stand]:
    leases = {row.id: canonical.minutes_before(now, from_json(row.definition).lease_min) for row in versions}
    for stand in headcounts.stands(db, study_id, leases):
        yield stand._replace(standing=ABANDONED) if stand.standing == AWAY else stand


def by_standing(stands: Sequence[Stand]) -> Counter[str]:
    people: Counter[str] = Counter()
    for stand in stands:
        people[stand.standing] += stand.people
    return people


def rows(study: str, found: Sequence[Flow]) -> Iterator[tuple[str, str, str | None, str, int | None]]:
    """The rows of flow.csv: study, mode, arm (empty: the whole study), stage, people (empty: unknown)."""
    for each in found:
        yield from ((study, each.mode, None, stage.value, people) for stage, people in each.whole.items())
        for arm, counts in each.arms.items():
            yield from ((study, each.mode, arm, stage.value, people) for stage, people in counts.items())
