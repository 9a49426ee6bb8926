"""The kill test: robots play while the server is killed with -9 and started again, again and again.

Each robot keeps a journal of every step that the server acknowledged. Afterwards the journal and the database
must hold the same steps: none missing, none doubled, none that nobody took.
"""

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random
from statistics import median
from typing import Protocol

from benchmarks.served import DatabaseName, Served, installed
from server.domain import canonical
from server.services.lab import Lab
from server.simulate.crowd import Crowd, play
from server.simulate.robot import Result, Step
from server.storage import events, participants, trials

TEMPLATES = ("parent-child", "traffic-junction")
POLL_S = 0.01
PAUSE_MAX_S = 0.05
"""A kill comes up to this long after the step that triggers it: anywhere in the next request."""


@dataclass(frozen=True, slots=True)
class Ordeal:
    """How hard it gets. A kill comes after `steps_between` acknowledged steps (a range to draw from)."""

    database: DatabaseName
    kills: int
    robots: int
    trials_per_block: int
    steps_between: tuple[int, int]
    seed: int = 1


class Dying(Protocol):
    """What the killer must know of an ordeal."""

    @property
    def kills(self) -> int: ...
    @property
    def steps_between(self) -> tuple[int, int]: ...
    @property
    def seed(self) -> int: ...


@dataclass(slots=True)
class Report:
    """What came of it."""

    ordeal: Ordeal
    workers: int
    kills: int = 0
    finished: int = 0
    acknowledged: int = 0
    missing: int = 0
    doubled: int = 0
    unknown: int = 0
    stale: int = 0
    sent_again: int = 0
    participants: int = 0
    seconds: float = 0.0
    restarts_s: list[float] = field(default_factory=list)
    errors: tuple[str, ...] = ()
    verify_exit: int = -1
    verify_said: str = ""

    @property
    def clean(self) -> bool:
        lost = self.missing + self.doubled + self.unknown + self.stale
        everybody = self.finished == self.participants == self.ordeal.robots
        return everybody and not lost and self.kills == self.ordeal.kills and self.verify_exit == 0

    @property
    def restart_s(self) -> float:
        return median(self.restarts_s)


def torture(ordeal: Ordeal) -> Report:
    """Run one ordeal from an empty database to the last check."""
    with installed(ordeal.database) as house:
        slugs = [
            house.add_study(name, places=1_000, trials_per_block=ordeal.trials_per_block)
            for name in TEMPLATES
        ]
        report = Report(ordeal, house.workers)
        house.start()
        begun = time.monotonic()
        try:
            results = asyncio.run(_suffer(house, ordeal, slugs, report))
        finally:
            house.kill()
        report.seconds = time.monotonic() - begun
        judge(house, results, report)
    return report


async def _suffer(house: Served, ordeal: Ordeal, slugs: Sequence[str], report: Report) -> list[Result]:
    """Let the robots play and the server die; give what came of every robot."""
    share = [len(range(place, ordeal.robots, len(slugs))) for place in range(len(slugs))]
    journals: list[Result] = []
    crowds = [
        Crowd(slug, robots, seed=ordeal.seed, url=house.url, style="mixed", concurrency=robots)
        for slug, robots in zip(slugs, share, strict=True)
        if robots
    ]
    playing = [
        asyncio.ensure_future(play(crowd, lambda slug=crowd.slug: house.sign(slug), journals=journals))
        for crowd in crowds
    ]
    killer = asyncio.ensure_future(kill_again_and_again(house, ordeal, lambda: journals, report))
    results = [result for crowd in await asyncio.gather(*playing) for result in crowd]
    killer.cancel()
    await asyncio.gather(killer, return_exceptions=True)
    return results


async def kill_again_and_again(
    house: Served, ordeal: Dying, journals: Callable[[], Sequence[Result]], report: Report
) -> None:
    """Kill the server each time so many more steps were acknowledged, and start it again."""
    random = Random(ordeal.seed)

    def acknowledged() -> int:
        return sum(len(journal.steps) for journal in journals())

    for _ in range(ordeal.kills):
        due = acknowledged() + random.randint(*ordeal.steps_between)
        while acknowledged() < due:  # noqa: ASYNC110 - the robots know nothing of the test that they are in
            await asyncio.sleep(POLL_S)
        await asyncio.sleep(random.random() * PAUSE_MAX_S)
        house.kill()
        report.kills += 1
        report.restarts_s.append(await asyncio.to_thread(house.start))


def judge(house: Served, results: Sequence[Result], report: Report) -> None:
    """Compare the journals with the database, and let `hatlab verify` look at everything."""
    with house.lab() as lab:
        for result in results:
            compare(result.steps, stored(lab, result.key), report)
        with lab.database.reading() as db:
            report.participants = sum(1 for _ in participants.stream(db))
    report.finished = sum(result.finished for result in results)
    report.stale = sum(result.stale for result in results)
    report.sent_again = sum(result.retries for result in results)
    report.errors = tuple(f"robot {r.index}: {r.error}" for r in results if r.error)
    verified = house.hatlab("verify")
    report.verify_exit, report.verify_said = verified.returncode, (verified.stdout + verified.stderr).strip()


def compare(journal: Sequence[Step], log: Sequence[Step], report: Report) -> None:
    """Count what the journal and the log do not have in common."""
    report.acknowledged += len(journal)
    report.missing += (Counter(journal) - Counter(log)).total()
    report.unknown += (Counter(log) - Counter(journal)).total()
    places = Counter((step.round, step.seq) for step in log)
    report.doubled += sum(count - 1 for count in places.values())


def stored(lab: Lab, key: str) -> list[Step]:
    """Give the decisions of a participant as they stand in the database."""
    with lab.database.reading() as db:
        person = participants.by_key(db, canonical.sha256(key))
        return [
            Step(trial.round, row.seq, canonical.loads(row.body)["action"])
            for trial in (trials.of_participant(db, person.id) if person else ())
            for row in events.of_trial(db, trial.id)[1:]
        ]
