"""The participant's side of the fake Prolific over HTTP, as the contract's people."""

from collections.abc import Sequence
from typing import Any

import httpx

from tests.server.recruitment.contract import NoPlaceError, Taken


class FakePeople:
    def __init__(self, url: str) -> None:
        self._client = httpx.Client(base_url=url, transport=httpx.HTTPTransport())

    def close(self) -> None:
        self._client.close()

    def take(self, posting_id: str) -> Taken:
        answer = self._client.post(f"/fake/studies/{posting_id}/take")
        if answer.status_code == httpx.codes.BAD_REQUEST:
            raise NoPlaceError(answer.text)
        told = answer.raise_for_status().json()
        taken = Taken(told["submission_id"], told["participant_id"], told["entry_url"])
        self._do(taken, "begin")
        return taken

    def hand_in(self, taken: Taken, code: str) -> None:
        self._do(taken, f"hand_in?code={code}")

    def give_back(self, taken: Taken) -> None:
        self._do(taken, "give_back")

    def time_out(self, taken: Taken) -> None:
        self._do(taken, "time_out")

    def rewards(self, taken: Taken) -> int:
        return len(self.ledger()["submissions"][taken.submission_id]["rewards"])

    def bonuses(self, taken: Taken) -> Sequence[int]:
        return list(self.ledger()["submissions"][taken.submission_id]["bonuses"])

    def ledger(self) -> Any:
        return self._client.get("/fake/ledger").raise_for_status().json()

    def advance(self, seconds: float) -> None:
        self._client.post("/fake/clock", params={"seconds": seconds}).raise_for_status()

    def plan_fault(self, **fault: Any) -> None:
        self._client.post("/fake/faults", json=fault).raise_for_status()

    def faults(self) -> Any:
        return self._client.get("/fake/faults").raise_for_status().json()

    def _do(self, taken: Taken, what: str) -> None:
        self._client.post(f"/fake/submissions/{taken.submission_id}/{what}").raise_for_status()
