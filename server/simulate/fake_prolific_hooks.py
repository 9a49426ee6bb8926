"""Webhooks of the fake marketplace: signed like Prolific's, sometimes twice, late or out of order. Seeded."""

import heapq
import json
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import count
from random import Random
from typing import Any

import httpx
from pydantic import SecretStr

from server.recruitment.prolific_webhook import EVENT, signature
from server.simulate.fake_prolific_records import Refusal, Submission

WORKSPACE = "fake-workspace"
ATTEMPTS = 4
PAUSE_S = 0.5  # before the first repetition; twice as long each time
TIMEOUT_S = 5.0

Send = Callable[[str, Mapping[str, str], bytes], int]


@dataclass(slots=True)
class Subscription:
    id: str
    target_url: str
    event_type: str = EVENT
    workspace_id: str = WORKSPACE
    is_enabled: bool = False
    confirmation: str = ""

    def shown(self) -> dict[str, Any]:
        names = ("id", "event_type", "target_url", "workspace_id", "is_enabled")
        return {name: getattr(self, name) for name in names}


@dataclass(order=True, slots=True)
class Delivery:
    """One message on its way; a repetition keeps the event's id."""

    due_s: float
    number: int
    target_url: str = field(compare=False)
    event_id: str = field(compare=False)
    happened_s: float = field(compare=False)
    body: bytes = field(compare=False)
    attempt: int = field(compare=False, default=1)


def post(url: str, headers: Mapping[str, str], body: bytes) -> int:
    """Send a message; 0: nobody there."""
    try:
        return httpx.post(url, headers=dict(headers), content=body, timeout=TIMEOUT_S).status_code
    except httpx.HTTPError:
        return 0


class Hooks:
    """Subscriptions, and the thread that delivers.

    Args:
        twice: Share of messages that are sent a second time.
        late: Share of messages that come up to `late_s` late, and so out of order.
    """

    def __init__(
        self,
        seed: int = 0,
        *,
        secret: str | None = None,
        twice: float = 0.1,
        late: float = 0.2,
        late_s: float = 3.0,
        send: Send = post,
    ) -> None:
        self.secret = secret
        self.subscriptions: dict[str, Subscription] = {}
        self._random = Random(f"hooks/{seed}")  # noqa: S311 (a simulation)
        self._twice = twice
        self._late = late
        self._late_s = late_s
        self._send = send
        self._numbers = count()
        self._waiting: list[Delivery] = []
        self._busy = 0
        self._changed = threading.Condition()
        self._stopped = False
        threading.Thread(target=self._deliver, name="fake-prolific-hooks", daemon=True).start()

    def new_secret(self) -> str:
        with self._changed:
            self.secret = f"{self._random.getrandbits(256):064x}"
            return self.secret

    def subscribe(self, target_url: str, event_type: str = EVENT, *, confirmed: bool = False) -> Subscription:
        if self.secret is None:
            raise Refusal(400, "Create a secret for the workspace first")
        if not target_url.startswith(("https://", "http://127.0.0.1", "http://localhost")):
            raise Refusal(400, {"target_url": ["Must begin with https://"]})
        with self._changed:
            made = Subscription(self._id(), target_url, event_type, is_enabled=confirmed)
            made.confirmation = self._id()
            self.subscriptions[made.id] = made
            return made

    def confirm(self, subscription_id: str, confirmation: object) -> Subscription:
        found = self.subscriptions.get(subscription_id)
        if found is None:
            raise Refusal(404, "Subscription not found", "Not found")
        if confirmation != found.confirmation:
            raise Refusal(400, {"secret": ["Is not the one of X-Hook-Secret"]})
        found.is_enabled = True
        return found

    def tell(self, submission: Submission) -> None:
        """Announce the state that a submission has now to whoever wants to know."""
        message = {
            "resource_id": submission.id,
            "event_type": EVENT,
            "participant_id": submission.participant_id,
            "status": submission.status,
        }
        with self._changed:
            for each in self.subscriptions.values():
                if each.is_enabled and each.event_type == EVENT:
                    self._announce(each.target_url, json.dumps(message).encode())

    def wait(self, timeout_s: float = 10.0) -> bool:
        """Until nothing is on its way any more."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._waiting and not self._busy, timeout_s)

    def stop(self) -> None:
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def _announce(self, target_url: str, body: bytes) -> None:
        now_s = time.time()
        event_id = self._id()
        for _ in range(2 if self._random.random() < self._twice else 1):
            lag_s = self._random.uniform(0, self._late_s) if self._random.random() < self._late else 0.0
            self._queue(Delivery(now_s + lag_s, next(self._numbers), target_url, event_id, now_s, body))

    def _queue(self, delivery: Delivery) -> None:
        heapq.heappush(self._waiting, delivery)
        self._changed.notify_all()

    def _deliver(self) -> None:
        while (delivery := self._next()) is not None:
            status = self._send(delivery.target_url, self._headers(delivery), delivery.body)
            with self._changed:
                self._busy -= 1
                if not 200 <= status < 300 and delivery.attempt < ATTEMPTS:
                    delivery.due_s = time.time() + PAUSE_S * 2 ** (delivery.attempt - 1)
                    delivery.attempt += 1
                    self._queue(delivery)
                self._changed.notify_all()

    def _next(self) -> Delivery | None:
        """The next message when it is due; None: stop."""
        with self._changed:
            while not self._stopped:
                wait_s = self._waiting[0].due_s - time.time() if self._waiting else None
                if wait_s is not None and wait_s <= 0:
                    self._busy += 1
                    return heapq.heappop(self._waiting)
                self._changed.wait(wait_s)
            return None

    def _headers(self, delivery: Delivery) -> dict[str, str]:
        now = str(int(time.time()))
        return {
            "Content-Type": "application/json",
            "X-Event-ID": delivery.event_id,
            "X-Timestamp": f"{delivery.happened_s:.3f}",
            "X-Prolific-Request-Timestamp": now,
            "X-Prolific-Request-Signature": signature(SecretStr(self.secret or ""), now, delivery.body),
        }

    def _id(self) -> str:
        return f"{self._random.getrandbits(96):024x}"
