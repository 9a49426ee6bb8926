"""A light load: people who are already playing, over raw HTTP/1.1 on one kept connection each.

The full robots of `hatlab simulate` cost as much CPU as the server, and both share the machine's cores.
These players enter as full robots do, play practice, and then send prepared bytes; what they get is read only
as far as it decides what to send next. Whoever has no round left is followed by the next person.
"""

import asyncio
import json
import ssl
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from random import Random
from typing import Any, NamedTuple

import httpx

from server.simulate import pages
from server.simulate.browser import Browser
from server.simulate.crowd import USER_AGENT, Crowd
from server.simulate.robot import DEVICE
from server.simulate.timing import Stopwatch

GO, BRAKE = 0, 1
GO_SHARE = 0.25
"""Of the decisions: rounds last long, so that steps are measured and not the beginning of rounds."""
ENTER_AT_ONCE = 8


class Seat(NamedTuple):
    """Where somebody who has come through consent and instructions plays."""

    host: str
    port: int
    round_path: str
    step_path: str
    person: int


async def enter(url: str, host: str, port: int, slug: str, people: int, sign: Any) -> list[Seat]:
    """Bring people to the page of their first round."""
    crowd = Crowd(slug, people, seed=1, url=url)
    context = ssl.create_default_context()
    places = asyncio.Semaphore(ENTER_AT_ONCE)

    async def one(index: int) -> Seat:
        transport = httpx.AsyncHTTPTransport(verify=context)
        async with places, Browser(url, transport, sign(slug), USER_AGENT) as browser:
            page = pages.read((await browser.get(crowd.entry(index))).text)
            for ending, fields in (("/consent", {"agree": "yes", **DEVICE}), ("/next", {})):
                form = page.form_to(ending)
                assert form is not None, page.title
                page = pages.read((await browser.post_form(form.action, form.filled(**fields))).text)
            assert page.data is not None, page.title
            return Seat(host, port, page.data["round_url"], page.data["step_url"], index)

    return list(await asyncio.gather(*(one(index) for index in range(people))))


@dataclass(slots=True)
class Player:
    """One connection and the round that is being played on it."""

    queue: list[Seat]
    """People who have not played yet."""
    seat: Seat
    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter
    random: Random
    stopwatch: Stopwatch
    round: int = 0
    seq: int = 0
    over: bool = True
    phase: str = ""
    latencies_ms: list[float] = field(default_factory=list)

    async def step(self) -> None:
        """Take one step, after opening a round if none is open."""
        while self.over:
            await self._open()
        timing = self.stopwatch.decision()
        action = GO if self.phase == "practice" or self.random.random() < GO_SHARE else BRAKE
        self.seq += 1
        body = {"round": self.round, "seq": self.seq, "action": action, "timing": timing}
        content = json.dumps(body).encode()
        began = time.perf_counter()
        answer = await self._post(self.seat.step_path, content)
        self.latencies_ms.append((time.perf_counter() - began) * 1000)
        self.over = b'"over":null' not in answer

    async def _open(self) -> None:
        after = {"after": self.round or None}
        view = json.loads(await self._post(self.seat.round_path, json.dumps(after).encode()))
        if "page" in view:
            self.seat, self.round = self.queue.pop(), 0
            return
        self.round, self.seq, self.phase = view["round"], view["seq"], view["phase"]
        self.over = False

    async def _post(self, path: str, content: bytes) -> bytes:
        head = f"POST {path} HTTP/1.1\r\nHost: {self.seat.host}:{self.seat.port}\r\n"
        head += f"Content-Type: application/json\r\nContent-Length: {len(content)}\r\n\r\n"
        self.writer.write(head.encode() + content)
        headers = await self.reader.readuntil(b"\r\n\r\n")
        length = int(headers.lower().split(b"content-length:", 1)[1].split(b"\r\n", 1)[0])
        answer = await self.reader.readexactly(length)
        if not headers.startswith(b"HTTP/1.1 200"):
            raise RuntimeError(f"POST {path}: {headers[:20]!r} {answer[:300]!r}")
        return answer


@asynccontextmanager
async def player(queue: list[Seat]) -> AsyncIterator[Player]:
    """Connect the next person."""
    seat = queue.pop()
    reader, writer = await asyncio.open_connection(seat.host, seat.port)
    made = Player(queue, seat, reader, writer, Random(seat.person), Stopwatch("load", seat.person))
    try:
        yield made
    finally:
        writer.close()


@dataclass(slots=True)
class Load:
    """What came of one stretch of playing."""

    seconds: float = 0.0
    latencies_ms: list[float] = field(default_factory=list)

    @property
    def rate(self) -> float:
        return len(self.latencies_ms) / self.seconds


async def warm_up(players: Sequence[Player]) -> None:
    """Play practice, and open the first main round."""

    async def one(who: Player) -> None:
        while who.phase != "main":
            await who.step()

    await asyncio.gather(*(one(who) for who in players))


async def play(players: Sequence[Player], seconds: float, rate: float | None) -> Load:
    """Let everybody play for a while: `rate` steps a second each, or as fast as answers come."""
    begun = time.perf_counter()
    end = begun + seconds
    for who in players:
        who.latencies_ms.clear()

    async def one(place: int, who: Player) -> None:
        due = begun + (place / len(players)) / rate if rate else 0.0
        while (now := time.perf_counter()) < end:
            if rate:
                if due >= end:
                    return
                await asyncio.sleep(max(0.0, due - now))
                due += 1 / rate
            await who.step()

    await asyncio.gather(*(one(place, who) for place, who in enumerate(players)))
    took = time.perf_counter() - begun
    return Load(
        max(seconds, took) if not rate else seconds, [ms for who in players for ms in who.latencies_ms]
    )
