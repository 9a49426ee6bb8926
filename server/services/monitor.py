"""How a study goes: who holds which place, by arm, one mode at a time: people and robots never mix."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime

from server.domain import canonical
from server.domain.plan import page_kind
from server.domain.study import from_json
from server.services import lease
from server.services.lab import Lab
from server.services.studies import Study
from server.storage import headcounts, studies
from server.storage.database import DbSession
from server.storage.headcounts import Person, Tally

MODES = ("live", "test", "preview", "robot")
LEFT = ("away", "withdrawn", "timed_out", "returned", "rejected")
EXCLUDED = ("failed", "screened_out")
SHOWS = {"now": ("active",), "finished": ("finished",), "left": LEFT, "excluded": EXCLUDED}
"""Standings by what the list of people can show."""
WORDS = {
    "instructions": "How to play",
    "practice": "Practice",
    "quiz": "Quiz",
    "play": "Rounds",
    "survey": "Questionnaire",
    "probe": "What the signs mean",
    "complete": "Completion page",
}
"""What people call a page, by its kind."""
PEOPLE_MAX = 50


@dataclass(frozen=True, slots=True)
class Headcount:
    """`allocated` is the sum of the others.

    `left`: withdrew, returned, timed out, was rejected there, or was not seen for longer than the lease;
    `excluded`: failed the quiz or too many attention checks.
    """

    allocated: int
    finished: int
    active: int
    left: int
    excluded: int


@dataclass(frozen=True, slots=True)
class ArmCount:
    """One arm of one version. `free` counts the places of the newest version only (0 for earlier ones)."""

    version: int
    arm: str
    places: int
    free: int
    people: Headcount
    orders: tuple[tuple[str, int], ...]
    devices: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class ModeCounts:
    """All arms and versions of one mode."""

    people: Headcount
    places: int
    last_seen_utc: str


@dataclass(frozen=True, slots=True)
class PersonLine:
    """One person as the monitor lists them."""

    id: str
    version: int
    arm: str
    where: str
    rounds_done: int
    rounds: int
    standing: str
    ago: str
    last_seen_utc: str
    device: str


@dataclass(frozen=True, slots=True)
class Progress:
    """Everything that the monitor of a study counts, for every mode."""

    modes: dict[str, ModeCounts]
    arms: dict[str, tuple[ArmCount, ...]]
    newest: int


def counts(db: DbSession, lab: Lab, study: Study) -> Progress:
    """Count a study. A study that was never launched has no arms here and nobody in it."""
    found = headcounts.tallies(db, study.row.id, lease.began(db, lab, study.row.id))
    versions = studies.versions(db, study.row.id)
    places = {version.number: from_json(version.definition).arms for version in versions}
    newest = versions[-1].number if versions else 0
    arms: dict[str, tuple[ArmCount, ...]] = {}
    for mode in MODES:
        mine = [tally for tally in found if tally.mode == mode]
        lines = []
        for number in sorted(places, reverse=True):
            for arm in places[number]:
                here = [tally for tally in mine if tally.arm == arm.name]
                lines.append(arm_count(number, newest, arm.name, arm.places, here))
        arms[mode] = tuple(line for line in lines if line.version == newest or line.people.allocated)
    total = study.definition.places if study.definition else 0
    modes = {mode: mode_counts([tally for tally in found if tally.mode == mode], total) for mode in MODES}
    return Progress(modes, arms, newest)


def arm_count(version: int, newest: int, arm: str, places: int, tallies: Sequence[Tally]) -> ArmCount:
    """One line; `tallies` are those of this arm's name in every version, as allocation counts them."""
    mine = [tally for tally in tallies if tally.version == version]
    everywhere = headcount(tallies)
    free = max(0, places - everywhere.finished - everywhere.active) if version == newest else 0
    return ArmCount(
        version,
        arm,
        places,
        free,
        headcount(mine),
        split((tally.role_order, tally.people) for tally in mine),
        split((tally.device, tally.people) for tally in mine),
    )


def mode_counts(tallies: Sequence[Tally], places: int) -> ModeCounts:
    last = max((tally.last_seen_utc for tally in tallies), default="")
    return ModeCounts(headcount(tallies), places, last)


def headcount(tallies: Iterable[Tally]) -> Headcount:
    by: Counter[str] = Counter()
    for tally in tallies:
        by[tally.standing] += tally.people
    left, excluded = (sum(by[each] for each in standings) for standings in (LEFT, EXCLUDED))
    return Headcount(by.total(), by["finished"], by["active"], left, excluded)


def split(pairs: Iterable[tuple[str, int]]) -> tuple[tuple[str, int], ...]:
    by: Counter[str] = Counter()
    for name, people in pairs:
        by[name] += people
    return tuple(sorted(by.items()))


def people(db: DbSession, lab: Lab, study: Study, mode: str, show: str) -> tuple[PersonLine, ...]:
    """The last seen of a mode: who plays now, has finished, has left, or is excluded."""
    leases = lease.began(db, lab, study.row.id)
    rows = headcounts.people(db, study.row.id, mode, SHOWS[show], leases, PEOPLE_MAX)
    rounds = {each.number: rounds_of(each.definition) for each in studies.versions(db, study.row.id)}
    return tuple(person_line(row, rounds[row.version], lab.now()) for row in rows)


def rounds_of(definition: str) -> int:
    """All rounds of a session, practice included."""
    study = from_json(definition)
    blocks = len(study.role_orders[0].split("-"))
    return blocks * (study.practice_rounds + study.trials_per_block)


def person_line(row: Person, rounds: int, now: datetime) -> PersonLine:
    device = ", ".join(part for part in (row.device, row.browser) if part) or "unknown"
    return PersonLine(
        row.id,
        row.version,
        row.arm,
        where(row.page),
        row.rounds_done,
        rounds,
        row.standing,
        ago(row.last_seen_utc, now),
        row.last_seen_utc,
        device,
    )


def where(page: str) -> str:
    """The page a person is on, in words."""
    kind, block = page_kind(page)
    return f"{WORDS[kind]}, block {block}" if block else WORDS[kind]


def ago(then_utc: str, now: datetime) -> str:
    """How long ago, to one unit."""
    if not then_utc:
        return ""
    then = canonical.utc_moment(then_utc)
    seconds = max(0, int((now - then).total_seconds()))
    for size, unit in ((86_400, "day"), (3_600, "h"), (60, "min")):
        if seconds >= size:
            amount = seconds // size
            plural = "s" if unit == "day" and amount > 1 else ""
            return f"{amount} {unit}{plural} ago"
    return f"{seconds} s ago"
