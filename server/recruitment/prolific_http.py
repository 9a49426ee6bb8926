"""One HTTP connection to Prolific's API: the key, waiting when it is busy, and errors in one line.

Errors, all of them RecruiterErrors:

    RecruiterError
    ├── RefusedError   Prolific said no (4xx): nothing was done
    └── LostError      a request that must not be sent twice got no usable answer: it may have been done

The key is added to each request as it leaves. It is in no attribute that prints, and errors are raised
outside `except`, so that no traceback drags a request along.
"""

import random
import time
from collections.abc import Callable, Generator, Mapping
from email.utils import parsedate_to_datetime
from typing import Any
from urllib.parse import urlsplit

import httpx
from pydantic import SecretStr

from server.recruitment.recruiter import RecruiterError

TRIES = 5
FIRST_WAIT_S = 1.0
WAIT_MAX_S = 60.0  # a request that shall wait longer is given back to the caller: a worker is no waiting room
TIMEOUT_S = 30.0
DETAIL_MAX = 300
LOOPBACK = {"127.0.0.1", "localhost", "::1"}
NEVER_LEFT = (httpx.ConnectError, httpx.ConnectTimeout, httpx.PoolTimeout)
WITHOUT_KEY = "Prolific does not accept the key: put the account's API token into HATLAB_PROLIFIC_TOKEN"


class RefusedError(RecruiterError):
    """Prolific answered 4xx; nothing was done. `status` is the HTTP status."""

    def __init__(self, message: str, status: int, *, again: bool = False) -> None:
        super().__init__(message, again=again)
        self.status = status


class LostError(RecruiterError):
    """No usable answer to a request that may have been carried out and must not be sent again blindly."""


class Key(httpx.Auth):
    """Adds the Authorization header to a request on its way out."""

    def __init__(self, token: SecretStr) -> None:
        self._token = token

    def auth_flow(self, request: httpx.Request) -> Generator[httpx.Request, httpx.Response]:
        request.headers["Authorization"] = f"Token {self._token.get_secret_value()}"
        yield request


class Connection:
    """Sends requests; waits and repeats where that is safe.

    429: nothing was done, so any request is sent again, after `Retry-After` or ever longer pauses. No
    connection: nothing was sent, likewise. Timeouts and 5xx: only requests that are `repeatable`.
    """

    def __init__(
        self,
        api: str,
        token: SecretStr,
        *,
        transport: httpx.BaseTransport | None = None,
        sleep: Callable[[float], None] = time.sleep,
        jitter: Callable[[], float] = random.random,
        tries: int = TRIES,
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        check_address(api)
        check_token(token)
        self._token = token
        self._sleep = sleep
        self._jitter = jitter
        self._tries = tries
        self._client = httpx.Client(
            base_url=api.rstrip("/"), auth=Key(token), timeout=timeout_s, transport=transport
        )

    def close(self) -> None:
        self._client.close()

    def get(self, path: str, query: Mapping[str, str | int] | None = None) -> Any:
        return self.send("GET", path, query=query, repeatable=True)[0]

    def post(self, path: str, body: Mapping[str, Any], *, repeatable: bool = False) -> Any:
        return self.send("POST", path, body=body, repeatable=repeatable)[0]

    def patch(self, path: str, body: Mapping[str, Any]) -> Any:
        """Set fields to values: the same twice is the same."""
        return self.send("PATCH", path, body=body, repeatable=True)[0]

    def send(
        self,
        method: str,
        path: str,
        *,
        body: Mapping[str, Any] | None = None,
        query: Mapping[str, str | int] | None = None,
        repeatable: bool,
    ) -> tuple[Any, Mapping[str, str]]:
        """Send until there is an answer; give its JSON (None: no body) and its headers.

        Raises:
            RefusedError: Prolific said no.
            LostError: not repeatable, and nobody knows whether it was done.
            RecruiterError: it did not answer in time, however often it was asked.
        """
        for attempt in range(self._tries):
            answer = self._once(method, path, body, query)
            if not self._is_worth_repeating(answer, repeatable):
                break
            wait_s = self._wait_s(answer, attempt)
            if wait_s > WAIT_MAX_S or attempt == self._tries - 1:
                break
            self._sleep(wait_s)
        if isinstance(answer, httpx.Response) and answer.is_success:
            return self._json(answer, repeatable), answer.headers
        raise self._error(answer, repeatable)

    def _once(
        self, method: str, path: str, body: Mapping[str, Any] | None, query: Mapping[str, str | int] | None
    ) -> httpx.Response | httpx.HTTPError:
        try:
            return self._client.request(method, path, json=body, params=query)
        except httpx.HTTPError as error:
            return error

    def _is_worth_repeating(self, answer: httpx.Response | httpx.HTTPError, repeatable: bool) -> bool:
        if isinstance(answer, httpx.HTTPError):
            return repeatable or isinstance(answer, NEVER_LEFT)
        return answer.status_code == httpx.codes.TOO_MANY_REQUESTS or (repeatable and answer.is_server_error)

    def _wait_s(self, answer: httpx.Response | httpx.HTTPError, attempt: int) -> float:
        """What Prolific asks for, or twice as long each time, less up to half of it by chance."""
        asked = (
            retry_after_s(answer.headers.get("Retry-After")) if isinstance(answer, httpx.Response) else None
        )
        return asked if asked is not None else FIRST_WAIT_S * 2**attempt * (0.5 + self._jitter() / 2)

    def _json(self, answer: httpx.Response, repeatable: bool) -> Any:
        if not answer.content.strip():
            return None
        try:
            return answer.json()
        except ValueError:
            pass
        if repeatable:
            raise RecruiterError("Prolific's answer is not JSON: check the address in HATLAB_PROLIFIC_API")
        raise LostError("Prolific's answer cannot be read: look at Prolific's page whether it was done")

    def _error(self, answer: httpx.Response | httpx.HTTPError, repeatable: bool) -> RecruiterError:
        if isinstance(answer, NEVER_LEFT):
            return RecruiterError("Prolific cannot be reached: try again in some minutes", again=True)
        if isinstance(answer, httpx.HTTPError):
            return silence("Prolific did not answer in time", repeatable)
        if answer.status_code == httpx.codes.TOO_MANY_REQUESTS:
            busy = "Prolific asks for fewer requests: nothing was done, try again in some minutes"
            return RefusedError(busy, answer.status_code, again=True)
        if answer.is_server_error:
            return silence(f"Prolific has a fault of its own ({answer.status_code})", repeatable)
        return self._refusal(answer)

    def _refusal(self, answer: httpx.Response) -> RecruiterError:
        if answer.is_redirect:
            return RecruiterError("Prolific's address has moved: check HATLAB_PROLIFIC_API")
        said = detail(answer).replace(self._token.get_secret_value(), "…")[:DETAIL_MAX]
        known = {
            401: WITHOUT_KEY,
            403: f"the key in HATLAB_PROLIFIC_TOKEN may not do this: {said}",
            404: f"Prolific does not know it: check the id ({said})",
        }
        return RefusedError(
            known.get(answer.status_code, f"Prolific refused: {said}"), status=answer.status_code
        )


def silence(what: str, repeatable: bool) -> RecruiterError:
    """The error for an answer that did not come."""
    if repeatable:
        return RecruiterError(f"{what}: try again in some minutes", again=True)
    return LostError(f"{what}: look at Prolific whether it was done before you send it again")


def check_address(api: str) -> None:
    """Refuse to send the key in clear to anybody but this machine."""
    parts = urlsplit(api)
    if parts.scheme == "https" and parts.hostname:
        return
    if parts.scheme != "http" or parts.hostname not in LOOPBACK:
        raise RecruiterError("HATLAB_PROLIFIC_API must begin with https://")


def check_token(token: SecretStr) -> None:
    """Refuse what cannot stand in a header: the library's own message would repeat it."""
    value = token.get_secret_value()
    if not value or not all("!" <= sign <= "~" for sign in value):
        raise RecruiterError("HATLAB_PROLIFIC_TOKEN is not a key: copy it again from Prolific's settings")


def retry_after_s(header: str | None) -> float | None:
    """Seconds to wait; the header holds a number or a date."""
    if header is None:
        return None
    if header.strip().isdecimal():
        return float(header)
    try:
        return max(0.0, parsedate_to_datetime(header).timestamp() - time.time())
    except ValueError:
        return None


def detail(answer: httpx.Response) -> str:
    """What Prolific gives as the reason, in one line; its errors are `{"error": {"title", "detail"}}`."""
    try:
        body = answer.json()
    except ValueError:
        return f"status {answer.status_code}"
    error = body.get("error", body) if isinstance(body, dict) else body
    said = error.get("detail") or error.get("title") or error if isinstance(error, dict) else error
    return " ".join(flat(said).split()) or f"status {answer.status_code}"


def flat(said: Any) -> str:
    """A detail is a text, a list of texts, or lists of texts by field."""
    if isinstance(said, dict):
        return "; ".join(f"{field}: {flat(each)}" for field, each in said.items())
    if isinstance(said, list):
        return ", ".join(flat(each) for each in said)
    return str(said)
