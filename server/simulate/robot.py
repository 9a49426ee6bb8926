"""One robot participant: from consent over instructions, practice and blocks to completion, over HTTP."""

import asyncio
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import httpx

from server.simulate import pages
from server.simulate.browser import Browser, RobotError
from server.simulate.styles import Player, View
from server.simulate.timing import Stopwatch

CONFLICT, OK = 409, 200
GOOD_OUTCOMES = frozenset({"found", "arrived"})
PAGES_MAX = 40
DEVICE = {"device": "desktop", "browser": "hatlab robot", "viewport": "1280x720"}


class Step(NamedTuple):
    """A decision that the server has acknowledged."""

    round: int
    seq: int
    action: int


class LeftError(Exception):
    """Raised by a robot's `pace`: it walks away without a word, as people do."""


@dataclass(slots=True)
class Result:
    """What came of one robot."""

    index: int
    finished: bool = False
    left: bool = False
    """Walked away before the end."""
    code: str = ""
    """What the last page said to hand in."""
    error: str | None = None
    rounds: int = 0
    successes: int = 0
    steps: list[Step] = field(default_factory=list)
    latencies_ms: list[float] = field(default_factory=list)
    retries: int = 0
    stale: int = 0
    """Steps that the server refused because another decision was there; never, with one robot a session."""
    key: str = ""


@dataclass(slots=True)
class Robot:
    """One participant. `pace` is awaited before each decision (thinking time)."""

    browser: Browser
    entry: str
    player: Player
    stopwatch: Stopwatch
    result: Result
    pace: Callable[[], Any]
    answers: Mapping[str, str] = field(default_factory=dict)
    """Right answers by `<kind of form>.<question>`: a robot reads no instructions."""

    async def walk(self) -> Result:
        """Walk the whole flow; whatever stops the robot is kept in `result.error`."""
        try:
            await self._walk()
            self.result.finished = True
        except LeftError:
            self.result.left = True
        except RobotError as error:
            self.result.error = str(error)
        except (httpx.HTTPError, KeyError, TypeError, ValueError, IndexError) as error:
            self.result.error = f"{type(error).__name__}: {error}"
        self.result.retries = self.browser.retries
        return self.result

    async def _walk(self) -> None:
        response = page_of(await self.browser.get(self.entry))
        page = pages.read(response.text)
        consent = page.form_to("/consent")
        if consent is not None:
            fields = consent.filled(agree="yes", **DEVICE)
            response = page_of(await self.browser.post_form(consent.action, fields))
        here = response.url.path
        if not here.startswith("/p/"):
            raise RobotError(f"no session after consent: {pages.read(response.text).title!r}")
        self.result.key = here.split("/")[2]
        for _ in range(PAGES_MAX):
            page = pages.read(response.text)
            onward, asked = page.form_to("/next"), page.form_to("/answers")
            if asked is not None:
                fields = asked.filled(**self._answers_to(asked.fields["form"]))
                response = page_of(await self.browser.post_form(asked.action, fields))
            elif onward is not None:
                response = page_of(await self.browser.post_form(onward.action, onward.filled()))
            elif page.data is not None and "round_url" in page.data:
                here = await self._play(page.data["round_url"], page.data["step_url"])
                response = page_of(await self.browser.get(here))
            elif is_complete(page):
                self.result.code = page.texts["code"]
                return
            else:
                raise RobotError(f"a page that leads nowhere: {page.title!r}")
        raise RobotError(f"more than {PAGES_MAX} pages")

    def _answers_to(self, form: str) -> dict[str, str]:
        """The right answers where there are any, and words where a text is asked for."""
        kind = form.partition(":")[0]
        return {
            f"a.{name.partition('.')[2]}": value
            for name, value in self.answers.items()
            if name.partition(".")[0] == kind
        }

    async def _play(self, round_url: str, step_url: str) -> str:
        """Play the rounds of one page; give the address of the next page."""
        after: int | None = None
        while True:
            answer = json_of(await self.browser.post_json(round_url, {"after": after}))
            if "page" in answer:
                return str(answer["page"])
            view = await self._play_round(step_url, answer)
            after = view["round"]

    async def _play_round(self, step_url: str, view: View) -> View:
        """Play a round to its end; after a form the server shows the round before it, which is over."""
        if view["over"] is not None:
            return view
        while view["over"] is None:
            await self.pace()
            view = await self._step(step_url, view)
        self.player.learn(view)
        self.result.rounds += 1
        self.result.successes += view["over"]["outcome"] in GOOD_OUTCOMES
        return view

    async def _step(self, step_url: str, view: View) -> View:
        action = self.player.decide(view)
        seq = view["seq"] + 1
        body = {"round": view["round"], "seq": seq, "action": action, "timing": self.stopwatch.decision()}
        began = time.perf_counter()
        response = await self.browser.post_json(step_url, body)
        self.result.latencies_ms.append((time.perf_counter() - began) * 1000)
        if response.status_code == CONFLICT:
            self.result.stale += 1
            stale: View = response.json()["view"]
            return stale
        answer = json_of(response)
        self.result.steps.append(Step(view["round"], seq, action))
        return answer


def is_complete(page: pages.Page) -> bool:
    """Whether this is the last page: the one that shows a completion code."""
    return bool(page.texts.get("code"))


def page_of(response: httpx.Response) -> httpx.Response:
    """Let only pages through.

    Raises:
        RobotError: the server answered with an error page.
    """
    if response.status_code != OK:
        title = pages.read(response.text).title
        raise RobotError(
            f"{response.request.method} {response.request.url.path}: {response.status_code} {title}"
        )
    return response


def json_of(response: httpx.Response) -> dict[str, Any]:
    """Let only good JSON answers through.

    Raises:
        RobotError: the server answered with a problem.
    """
    if response.status_code != OK:
        said = f"{response.status_code} {response.text[:200]}"
        raise RobotError(f"{response.request.method} {response.request.url.path}: {said}")
    answer: dict[str, Any] = response.json()
    return answer


async def at_once() -> None:
    """Think no time at all."""


def every(period_s: float) -> Callable[[], Any]:
    """Think so that one decision follows the other after `period_s`, whatever the answers take."""
    due = [0.0]

    async def pace() -> None:
        now = time.monotonic()
        due[0] = max(due[0] + period_s, now) if due[0] else now + period_s
        await asyncio.sleep(due[0] - now)

    return pace
