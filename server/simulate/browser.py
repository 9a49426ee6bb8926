"""A robot's browser: cookies, redirects, and an outbox that sends the same body until it is answered."""

import asyncio
import time
from collections.abc import Mapping
from typing import Any, Self

import httpx

ANSWERS_MAX_S = 30.0
PATIENCE_S = 90.0
"""How long a robot goes on knocking at a server that does not answer."""
PAUSE_FIRST_S, PAUSE_MAX_S = 0.05, 1.0
TRY_AGAIN = frozenset({502, 503, 504})


class RobotError(Exception):
    """A robot could not go on; the message says where and why."""


class Browser:
    """One robot's connection to one server. `retries` counts requests that had to be sent again.

    Without a signature it passes for a person: for tests of recruitment, at a made-up marketplace.
    """

    def __init__(
        self, url: str, transport: httpx.AsyncBaseTransport, robot_signature: str | None, user_agent: str
    ) -> None:
        signed = {"X-Hatlab-Robot": robot_signature} if robot_signature else {}
        self._client = httpx.AsyncClient(
            base_url=url,
            transport=transport,
            headers={"User-Agent": user_agent, **signed},
            follow_redirects=True,
            timeout=httpx.Timeout(ANSWERS_MAX_S),
        )
        self.retries = 0

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._client.aclose()

    async def get(self, url: str) -> httpx.Response:
        return await self._until_answered("GET", url)

    async def post_form(self, url: str, fields: Mapping[str, str]) -> httpx.Response:
        return await self._until_answered("POST", url, data=dict(fields))

    async def post_json(self, url: str, body: Mapping[str, Any]) -> httpx.Response:
        return await self._until_answered("POST", url, json=dict(body))

    async def _until_answered(self, method: str, url: str, **content: Any) -> httpx.Response:
        """Send the same request until the server has answered it.

        Raises:
            RobotError: no answer for `PATIENCE_S`.
        """
        deadline, pause_s, trouble = time.monotonic() + PATIENCE_S, PAUSE_FIRST_S, ""
        while time.monotonic() < deadline:
            try:
                response = await self._client.request(method, url, **content)
            except httpx.TransportError as error:
                trouble = type(error).__name__
            else:
                if response.status_code not in TRY_AGAIN:
                    return response
                trouble = f"status {response.status_code}"
            self.retries += 1
            await asyncio.sleep(pause_s)
            pause_s = min(pause_s * 2, PAUSE_MAX_S)
        raise RobotError(f"{method} {url}: no answer for {PATIENCE_S:.0f} s ({trouble})")
