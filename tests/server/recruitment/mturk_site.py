"""The fake Mechanical Turk as tests use it: real HTTP on loopback, and a worker without a browser."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import httpx
import uvicorn
from pydantic import SecretStr

from server.recruitment.mturk_api import MTurkRecruiter
from server.recruitment.mturk_client import MTurkClient
from server.recruitment.recruiter import Posting
from server.serving import listen
from server.simulate.fake_mturk import ACCESS_KEY_ID, SECRET_ACCESS_KEY, fake_mturk
from server.simulate.mturk_market import Market

POSTING = Posting(
    slug="traffic-junction",
    title="Drive & brake: a <game>",
    description="Drive a car through a crossing.",
    entry_url="https://lab.example/s/traffic-junction?from=a&to=b",
    places=12,
    duration_min=20,
    time_limit_min=60,
    reward_minor=350,
    currency="USD",
    codes={"complete": "C0DE"},
    keywords=("game", "driving"),
)


@dataclass
class Worker:
    """What people do on the worker's site. `recruiter` and this are what the contract tests need."""

    url: str
    market: Market

    def take(self, recruiter: MTurkRecruiter, posting_id: str, person: str) -> str:
        """Accept a place of the posting; the id of the submission."""
        done = httpx.post(f"{self.url}/worker/accept/{self.hit_of(posting_id)}", data={"worker": person})
        assert done.status_code == 303, done.text
        return done.headers["location"].rsplit("/", 1)[1]

    def hand_in(self, submission_id: str, code: str) -> None:
        fields = {"assignmentId": submission_id, "code": code}
        done = httpx.post(f"{self.url}/mturk/externalSubmit", data=fields)
        assert done.status_code == 200, done.text

    def give_back(self, submission_id: str) -> None:
        assert httpx.post(f"{self.url}/worker/return/{submission_id}").status_code == 200

    def sees(self, posting_id: str, person: str) -> bool:
        """Whether the posting is among what this person finds."""
        listing = httpx.get(f"{self.url}/", params={"worker": person}).text
        return self.hit_of(posting_id) in listing

    def hit_of(self, posting_id: str) -> str:
        kind = posting_id.partition(":")[0]
        return next(hit.id for hit in self.market.hits.values() if hit.type_id == kind)


@dataclass
class Site:
    url: str
    market: Market
    worker: Worker

    def client(
        self, key: str = ACCESS_KEY_ID, secret: str = SECRET_ACCESS_KEY, attempts: int = 4
    ) -> MTurkClient:
        return MTurkClient(self.url, SecretStr(key), SecretStr(secret), attempts)

    def recruiter(self, client: MTurkClient | None = None) -> MTurkRecruiter:
        """A recruiter without any memory, which knows from our own records who holds an assignment."""
        market = self.market

        def worker_of(submission_id: str) -> str | None:
            held = market.assignments.get(submission_id)
            return held.worker if held else None

        return MTurkRecruiter(client or self.client(), self.url, worker_of, market.now)

    def ledger(self) -> Any:
        return httpx.get(f"{self.url}/fake/ledger").json()

    def rewards(self) -> list[tuple[str, str]]:
        return [(p["worker"], p["amount"]) for p in self.ledger()["payments"] if p["kind"] == "reward"]

    def bonuses(self) -> list[tuple[str, str]]:
        return [(p["worker"], p["amount"]) for p in self.ledger()["payments"] if p["kind"] == "bonus"]


@contextmanager
def mturk_site(seed: int = 1, delay_s: float = 0.0, throttle_every: int = 0) -> Iterator[Site]:
    """A fake that answers, in a thread of its own."""
    market = Market(seed, delay_s)
    place = listen("127.0.0.1", 0)
    server = uvicorn.Server(
        uvicorn.Config(fake_mturk(market, throttle_every), log_level="warning", access_log=False)
    )
    thread = threading.Thread(target=server.run, args=([place.listener],), daemon=True)
    thread.start()
    deadline = time.monotonic() + 20
    while not server.started and time.monotonic() < deadline:
        time.sleep(0.01)
    assert server.started
    try:
        yield Site(place.url, market, Worker(place.url, market))
    finally:
        server.should_exit = True
        thread.join(20)
        place.listener.close()
