"""The worker's side of the fake Mechanical Turk over HTTP, as the contract's people."""

from collections.abc import Sequence
from decimal import Decimal
from html.parser import HTMLParser
from itertools import count
from typing import Any

import httpx

from server.simulate.mturk_market import Market
from tests.server.recruitment.contract import NoPlaceError, Taken


class Frame(HTMLParser):
    """Where the frame of a task page leads."""

    address = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "iframe":
            self.address = dict(attrs)["src"] or ""


class FakeWorkers:
    """Workers who were never here before; the market only tells them which HIT is the posting's."""

    def __init__(self, url: str, market: Market) -> None:
        self._client = httpx.Client(base_url=url, transport=httpx.HTTPTransport())
        self._market = market
        self._numbers = count(1)

    def close(self) -> None:
        self._client.close()

    def take(self, posting_id: str) -> Taken:
        worker = f"AWORKER{next(self._numbers)}"
        hit = self._hit_of(posting_id)
        accepted = self._client.post(f"/worker/accept/{hit}", data={"worker": worker})
        if accepted.status_code == httpx.codes.FORBIDDEN:
            raise NoPlaceError(accepted.text)
        assert accepted.status_code == httpx.codes.SEE_OTHER, accepted.text
        task = accepted.headers["location"]
        frame = Frame()
        frame.feed(self._client.get(task).raise_for_status().text)
        return Taken(task.rsplit("/", 1)[1], worker, frame.address)

    def hand_in(self, taken: Taken, code: str) -> None:
        fields = {"assignmentId": taken.submission_id, "code": code}
        self._client.post("/mturk/externalSubmit", data=fields).raise_for_status()

    def give_back(self, taken: Taken) -> None:
        self._client.post(f"/worker/return/{taken.submission_id}").raise_for_status()

    def rewards(self, taken: Taken) -> int:
        return len(self._paid("reward", taken))

    def bonuses(self, taken: Taken) -> Sequence[int]:
        return self._paid("bonus", taken)

    def _paid(self, kind: str, taken: Taken) -> list[int]:
        ledger: Any = self._client.get("/fake/ledger").raise_for_status().json()
        return [
            int(Decimal(each["amount"]) * 100)
            for each in ledger["payments"]
            if (each["kind"], each["assignment"]) == (kind, taken.submission_id)
        ]

    def _hit_of(self, posting_id: str) -> str:
        kind = posting_id.partition(":")[0]
        found = next((hit.id for hit in self._market.hits.values() if hit.type_id == kind), None)
        if found is None:
            raise NoPlaceError(f"there is no HIT of {posting_id}")
        return found
