"""A whole study through a made-up Prolific, while the server is killed with -9 again and again.

People (robots without a robot's signature, in a study of this test's own) take a place there, play here, and
hand in their code there; some walk away, give the place back, withdraw, or answer the quiz wrong. Webhooks
come twice, late and out of order; every so many requests are answered 429. An experimenter goes on confirming
what the reconciler proposes. At the end every acknowledged step is stored once, and everybody was paid once.
"""

import asyncio
import contextlib
import hashlib
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any, Literal

import httpx

from benchmarks.served import DatabaseName, Served, installed
from server.domain import canonical
from server.domain.money import bonus_minor
from server.domain.study import StudyDefinition, answer_key
from server.services import recruit
from server.services.lab import Lab
from server.services.pages import WON
from server.services.session import definition_of
from server.simulate import styles
from server.simulate.browser import Browser
from server.simulate.crowd import USER_AGENT
from server.simulate.fake_prolific import FakeProlific, running
from server.simulate.fake_prolific_hooks import Hooks
from server.simulate.fake_prolific_market import Market
from server.simulate.fake_prolific_weather import Weather
from server.simulate.robot import LeftError, Result, Robot
from server.simulate.timing import Stopwatch
from server.storage import participants, trials
from tests.server.web.admin_site import fields_of
from tests.torture.torture import Report, compare, kill_again_and_again, stored

Fate = Literal["finish", "leave", "give back", "withdraw", "confused"]
DROPOUTS: tuple[Fate, ...] = ("leave", "give back", "withdraw", "confused")
TOKEN, HOOK_SECRET = "t0k3n-of-the-ordeal", "hook-secret-of-the-ordeal"
PASSWORD = "measurements only"
STEPS_BEFORE_LEAVING = (0, 30)
SETTLE_S = 3.0
ROUNDS_OF_CONFIRMING = 60
PAY = {
    "currency": "GBP",
    "reward_minor": 300,
    "partial_minor": 50,
    "screen_out_minor": 20,
    "bonus_success_minor": 5,
    "bonus_max_minor": 200,
    "cap_participant_minor": 500,
    "cap_study_minor": 1_000_000,
}
CODES = {"screened_out": "SCREENED-OUT", "failed": "", "withdrawn": "LEFT-EARLY"}
QUIZ = [
    {
        "key": "goal",
        "text": "What is the game about?",
        "options": ["Nothing", "The child or the road"],
        "answer": 2,
    }
]
CHECK = [{"key": "blue", "text": "Please choose blue.", "options": ["Red", "Blue"], "answer": 2, "after": 1}]
ASKED = [
    {
        "key": "load",
        "title": "How was it?",
        "when": "block",
        "items": [
            {"key": "effort", "text": "How hard was it?", "kind": "scale", "low": "low", "high": "high"}
        ],
    }
]


@dataclass(frozen=True, slots=True)
class Ordeal:
    """How hard it gets: people who finish by study, and people who drop out (shared between the studies)."""

    database: DatabaseName
    kills: int
    finishing: dict[str, int]
    dropouts: int
    trials_per_block: int
    steps_between: tuple[int, int]
    concurrency: int = 40
    seed: int = 1


@dataclass(slots=True)
class Settled:
    """What came of the money."""

    paid_once: int = 0
    wrong: list[str] = field(default_factory=list)
    payments: int = 0
    left_to_do: int = 0
    statuses: Counter[str] = field(default_factory=Counter)


@dataclass(slots=True)
class Person:
    """Somebody at the marketplace, and what came of them here."""

    slug: str
    fate: Fate
    index: int
    submission_id: str = ""
    result: Result | None = None


def ordeal_by_marketplace(ordeal: Ordeal) -> tuple[Report, Settled]:
    """Run one ordeal from an empty database to the last check."""
    people = [Person(slug, fate, index) for index, (slug, fate) in enumerate(fates(ordeal))]
    hooks = Hooks(ordeal.seed, secret=HOOK_SECRET, twice=0.3, late=0.3, late_s=2.0)
    market = Market(ordeal.seed, submit_lag_s=0.2)
    fake = FakeProlific(TOKEN, market, Weather(ordeal.seed, limit_429=0.1), hooks)
    with installed(ordeal.database) as house, running(fake) as url:
        house.extra = {
            "HATLAB_PROLIFIC_API": f"{url}/api/v1",
            "HATLAB_PROLIFIC_TOKEN": TOKEN,
            "HATLAB_PROLIFIC_WEBHOOK_SECRET": HOOK_SECRET,
            "HATLAB_PROLIFIC_SETTLE_S": str(SETTLE_S),
        }
        hooks.subscribe(f"{house.url}/hooks/prolific", confirmed=True)
        desk = Desk(house, url, open_studies(house, ordeal))
        report = Report(ordeal, house.workers)  # type: ignore[arg-type]
        house.start()
        begun = time.monotonic()
        try:
            asyncio.run(_suffer(house, ordeal, people, desk, report))
            hooks.wait()
            settled = desk.settle()
        finally:
            house.kill()
        report.seconds = time.monotonic() - begun
        judge(house, people, desk, settled, report)
    return report, settled


def fates(ordeal: Ordeal) -> list[tuple[str, Fate]]:
    """Who does what, in the order in which they come."""
    slugs = list(ordeal.finishing)
    drawn: list[tuple[str, Fate]] = [
        (slug, "finish") for slug, n in ordeal.finishing.items() for _ in range(n)
    ]
    drawn += [
        (slugs[i % len(slugs)], DROPOUTS[i // len(slugs) % len(DROPOUTS)]) for i in range(ordeal.dropouts)
    ]
    Random(ordeal.seed).shuffle(drawn)
    return drawn


def open_studies(house: Served, ordeal: Ordeal) -> dict[str, str]:
    """Launch the studies in live mode; slug by template."""
    return {
        template: house.add_study(
            template,
            places=1_000,
            mode="live",
            trials_per_block=ordeal.trials_per_block,
            pay=PAY,
            codes=CODES,
            quiz=QUIZ,
            attention=CHECK,
            questionnaires=ASKED,
        )
        for template in ordeal.finishing
    }


class Desk:
    """The experimenter: posts the studies, and confirms what is proposed, over HTTP."""

    def __init__(self, house: Served, fake_url: str, slugs: dict[str, str]) -> None:
        self.house, self.fake_url, self.slugs = house, fake_url, slugs
        self.postings: dict[str, tuple[int, str]] = {}
        self.definitions: dict[str, StudyDefinition] = {}
        with self.lab() as lab:
            for template, slug in slugs.items():
                posting = recruit.create(lab, slug, "prolific", 500, f"A game: {slug}")
                recruit.publish(lab, posting)
                self.postings[template] = (posting, recruit.opened(lab, posting).row.external_id)
                self.definitions[template] = recruit.opened(lab, posting).study

    @contextlib.contextmanager
    def lab(self) -> Any:
        """The installation in this process, with the marketplace's settings."""
        from dataclasses import replace

        from pydantic import SecretStr

        with self.house.lab() as lab:
            changes = {
                "prolific_api": f"{self.fake_url}/api/v1",
                "prolific_token": SecretStr(TOKEN),
                "prolific_settle_s": SETTLE_S,
                "public_url": self.house.url,
            }
            yield replace(lab, settings=lab.settings.model_copy(update=changes))

    def sign_in(self) -> httpx.Client:
        client = httpx.Client(base_url=self.house.url, follow_redirects=True, timeout=60)
        page = client.get("/admin/login").text
        fields = fields_of(page, "/admin/login")
        client.post("/admin/login", data={**fields, "username": "admin", "password": PASSWORD})
        return client

    def round(self) -> int:
        """Ask the marketplace and confirm everything that can be done; how much that was."""
        done = 0
        with contextlib.closing(self.sign_in()) as client:
            for template, (posting, _) in self.postings.items():
                base = f"/admin/studies/{self.slugs[template]}/recruitment"
                csrf = fields_of(client.get(base).text, "/admin/logout")["csrf"]
                client.post(f"{base}/{posting}/poll", data={"csrf": csrf})
                page = client.get(base).text
                keys = [part.split('"')[0] for part in page.split('name="do.')[1:]]
                if keys:
                    fields = {f"do.{key}": "1" for key in keys}
                    client.post(f"{base}/{posting}/confirm", data={"csrf": csrf, **fields})
                done += len(keys)
        return done

    def settle(self) -> Settled:
        """Confirm until nothing is left that can be done."""
        settled = Settled()
        for _ in range(ROUNDS_OF_CONFIRMING):
            settled.left_to_do = self.round()
            if settled.left_to_do == 0:
                break
            time.sleep(0.5)
        return settled

    async def go_on(self) -> None:
        """Confirm while people play and the server dies; a dead server is waited for."""
        while True:
            with contextlib.suppress(httpx.HTTPError, KeyError, ValueError):
                await asyncio.to_thread(self.round)
            await asyncio.sleep(1.0)


async def _suffer(
    house: Served, ordeal: Ordeal, people: Sequence[Person], desk: Desk, report: Report
) -> None:
    places = asyncio.Semaphore(ordeal.concurrency)

    async def one(person: Person) -> None:
        async with places:
            await live(person, house, desk, ordeal.seed)

    def journals() -> list[Result]:
        return [person.result for person in people if person.result]

    killer = asyncio.ensure_future(kill_again_and_again(house, ordeal, journals, report))
    experimenter = asyncio.ensure_future(desk.go_on())
    await asyncio.gather(*(one(person) for person in people))
    experimenter.cancel()
    await asyncio.gather(experimenter, return_exceptions=True)
    killer.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await killer  # a server that did not come back is said here


async def live(person: Person, house: Served, desk: Desk, seed: int) -> None:
    """Take a place, play or not, and hand in what the last page said."""
    _, study_there = desk.postings[person.slug]
    async with httpx.AsyncClient(base_url=desk.fake_url, timeout=60) as site:
        who = hashlib.sha256(f"{seed}/{person.index}".encode()).hexdigest()[:24]
        taken = (await site.post(f"/fake/studies/{study_there}/take?participant_id={who}")).json()
        person.submission_id = taken["submission_id"]
        await site.post(f"/fake/submissions/{person.submission_id}/begin")
        async with Browser(house.url, httpx.AsyncHTTPTransport(), None, USER_AGENT) as browser:
            entry = taken["entry_url"].removeprefix(house.url)
            person.result = Result(person.index)
            robot = Robot(
                browser,
                entry,
                styles.player("mixed", str(seed), person.index),
                Stopwatch(str(seed), person.index),
                person.result,
                pace_of(person, seed),
                answers_of(person, desk.definitions[person.slug]),
            )
            await robot.walk()
            code = person.result.code
            if person.fate == "withdraw" and person.result.key:
                where = f"/p/{person.result.key}/withdraw"
                page = await browser.post_form(where, {"keep": "yes"})
                code = CODES["withdrawn"] if CODES["withdrawn"] in page.text else "NOCODE"
        await leave_site(site, person, code)


async def leave_site(site: httpx.AsyncClient, person: Person, code: str) -> None:
    if person.fate == "leave":
        await site.post(f"/fake/submissions/{person.submission_id}/time_out")
    elif person.fate == "give back":
        await site.post(f"/fake/submissions/{person.submission_id}/give_back")
    else:
        await site.post(f"/fake/submissions/{person.submission_id}/hand_in?code={code}")


def pace_of(person: Person, seed: int) -> Callable[[], Awaitable[None]]:
    """Whoever drops out walks away after so many decisions."""
    random = Random(f"{seed}/{person.index}/leaves")
    left = [random.randint(*STEPS_BEFORE_LEAVING)]

    async def pace() -> None:
        if person.fate in {"finish", "confused"}:
            return
        if left[0] == 0:
            raise LeftError
        left[0] -= 1

    return pace


def answers_of(person: Person, study: StudyDefinition) -> dict[str, str]:
    right = answer_key(study)
    if person.fate == "confused":
        return {**right, "quiz.goal": "1"}
    return right


def judge(house: Served, people: Sequence[Person], desk: Desk, settled: Settled, report: Report) -> None:
    """Compare journals, database and the marketplace's books."""
    books = httpx.get(f"{desk.fake_url}/fake/ledger").json()
    settled.payments = len(books["payments"])
    with house.lab() as lab:
        for person in people:
            assert person.result is not None
            compare(person.result.steps, stored(lab, person.result.key), report)
            judge_money(lab, person, books["submissions"][person.submission_id], settled)
        with lab.database.reading() as db:
            statuses = Counter(each.status for each in participants.stream(db))
        settled.statuses = statuses
        report.participants = statuses.total()
    results = [person.result for person in people if person.result]
    report.finished = sum(result.finished or result.left for result in results)
    report.stale = sum(result.stale for result in results)
    report.sent_again = sum(result.retries for result in results)
    report.errors = tuple(f"person {r.index}: {r.error}" for r in results if r.error)
    verified = house.hatlab("verify")
    report.verify_exit, report.verify_said = verified.returncode, (verified.stdout + verified.stderr).strip()


def judge_money(lab: Lab, person: Person, book: dict[str, list[int]], settled: Settled) -> None:
    """What somebody got beside what is owed by what is stored."""
    assert person.result is not None
    with lab.database.reading() as db:
        row = participants.by_key(db, canonical.sha256(person.result.key))
        if row is None:
            settled.wrong.append(f"person {person.index} ({person.fate}) is not stored")
            return
        won = trials.won(db, row.study_id, WON).get(row.id, 0)
        study = definition_of(db, lab, row.study_version_id)
    owed: dict[str, tuple[list[int], list[int]]] = {
        "finished": ([PAY["reward_minor"]], [bonus] if (bonus := bonus_minor(study.pay, won)) else []),  # type: ignore[list-item]
        "withdrawn": ([], [PAY["partial_minor"]]),  # type: ignore[list-item]
    }
    rewards, bonuses = owed.get(row.status, ([], []))
    got = (len(book["rewards"]), sorted(book["bonuses"]))
    if got == (len(rewards), bonuses):
        settled.paid_once += 1
    else:
        settled.wrong.append(
            f"person {person.index} ({person.fate}, {row.status}): got {got}, owed {rewards} {bonuses}"
        )
