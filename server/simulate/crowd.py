"""Many robots at once against one server, each as its own participant with its own marketplace id.

What a robot chooses depends on the seed and on what the server shows it; its marketplace id also on `run`, so
that a second run brings new people.
"""

import asyncio
import hashlib
import math
import secrets
import ssl
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from urllib.parse import urlsplit

import httpx

from server.simulate import styles
from server.simulate.browser import Browser
from server.simulate.robot import Result, Robot, at_once, every
from server.simulate.timing import Stopwatch

USER_AGENT = "Mozilla/5.0 (X11; Linux x86_64) hatlab-robot/1.0"
REACH_S = 5.0


class UnreachableError(Exception):
    """No hatlab server answers, or it has no such study; the message says what to do."""


@dataclass(frozen=True, slots=True)
class Crowd:
    """What to run: `participants` robots in one study, at most `concurrency` at once.

    `rate` is decisions a second of each robot, None: as fast as answers come.
    """

    slug: str
    participants: int
    seed: int
    url: str = "http://127.0.0.1:8000"
    style: styles.StyleName = "sensible"
    concurrency: int = 20
    rate: float | None = None
    run: str = field(default_factory=lambda: secrets.token_hex(8))
    answers: Mapping[str, str] = field(default_factory=dict)
    """Right answers to quiz and attention checks, by `<kind>.<question>`."""

    def entry(self, index: int) -> str:
        """Give the link that a marketplace would send robot `index` to."""
        person, study, session = (self._hex(f"{kind}/{index}") for kind in ("person", "study", "session"))
        return f"/s/{self.slug}?PROLIFIC_PID={person}&STUDY_ID={study}&SESSION_ID={session}"

    def _hex(self, text: str) -> str:
        return hashlib.sha256(f"{self.run}/{text}".encode()).hexdigest()[:24]


@dataclass(frozen=True, slots=True)
class Summary:
    """The figures of one run."""

    participants: int
    finished: int
    rounds: int
    successes: int
    steps: int
    retries: int
    latency_median_ms: float
    latency_p99_ms: float
    errors: tuple[str, ...]

    @property
    def complete(self) -> bool:
        return self.finished == self.participants


def simulate(
    crowd: Crowd, sign: Callable[[], str], on_done: Callable[[Result], None] | None = None
) -> list[Result]:
    """Run the robots to their end; `sign` gives a fresh robot signature for the study.

    Raises:
        UnreachableError: no hatlab server with this study answers at the address.
    """
    return asyncio.run(_simulate(crowd, sign, on_done))


async def _simulate(
    crowd: Crowd, sign: Callable[[], str], on_done: Callable[[Result], None] | None
) -> list[Result]:
    await _reach(crowd)
    return await play(crowd, sign, on_done)


async def _reach(crowd: Crowd) -> None:
    url = crowd.url
    advice = f"no hatlab server answers at {url}: start one with `hatlab serve`, or name another with --url"
    try:
        urlsplit(url).port  # noqa: B018 (refuses a port that cannot be)
        async with httpx.AsyncClient(base_url=url, timeout=REACH_S) as client:
            health = await client.get("/healthz")
            study = await client.get(f"/s/{crowd.slug}")
    except (httpx.HTTPError, httpx.InvalidURL, ValueError) as error:
        raise UnreachableError(advice) from error
    if not health.headers.get("content-type", "").startswith("application/json"):
        raise UnreachableError(advice)
    if study.status_code == httpx.codes.NOT_FOUND:
        raise UnreachableError(f"no study is called {crowd.slug} at {url}")


async def play(
    crowd: Crowd,
    sign: Callable[[], str],
    on_done: Callable[[Result], None] | None = None,
    journals: list[Result] | None = None,
) -> list[Result]:
    """Run the robots without asking first whether the server is there.

    Each robot's result is put into `journals` as it begins, and grows there while it plays.
    """
    places = asyncio.Semaphore(crowd.concurrency)
    context = ssl.create_default_context()

    async def one(index: int) -> Result:
        transport = httpx.AsyncHTTPTransport(verify=context)
        async with places, Browser(crowd.url, transport, sign(), USER_AGENT) as browser:
            walker = robot(crowd, index, browser)
            if journals is not None:
                journals.append(walker.result)
            result = await walker.walk()
        if on_done is not None:
            on_done(result)
        return result

    return list(await asyncio.gather(*(one(index) for index in range(crowd.participants))))


def robot(crowd: Crowd, index: int, browser: Browser) -> Robot:
    """Make robot `index` of a crowd."""
    seed = str(crowd.seed)
    return Robot(
        browser=browser,
        entry=crowd.entry(index),
        player=styles.player(crowd.style, seed, index),
        stopwatch=Stopwatch(seed, index),
        result=Result(index),
        pace=every(1 / crowd.rate) if crowd.rate else at_once,
        answers=crowd.answers,
    )


def summary(results: Sequence[Result]) -> Summary:
    """Add up what came of the robots."""
    latencies = sorted(latency for result in results for latency in result.latencies_ms)
    return Summary(
        participants=len(results),
        finished=sum(result.finished for result in results),
        rounds=sum(result.rounds for result in results),
        successes=sum(result.successes for result in results),
        steps=sum(len(result.steps) for result in results),
        retries=sum(result.retries for result in results),
        latency_median_ms=median(latencies) if latencies else math.nan,
        latency_p99_ms=quantile(latencies, 0.99),
        errors=tuple(f"robot {r.index}: {r.error}" for r in results if r.error),
    )


def quantile(ordered: Sequence[float], share: float) -> float:
    """Give the smallest value that at least `share` of the ordered values do not exceed.

    >>> quantile([1, 2, 3, 4], 0.5)
    2
    """
    if not ordered:
        return math.nan
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)]
