"""Errors as answers: a page for people, problem JSON (RFC 9457) for scripts, an incident number for bugs.

The log never holds a path, a parameter or a foreign error's message: session keys and marketplace ids stand
in them. The details of our own errors name neither.
"""

import json
import secrets
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.domain.errors import HatlabError, StaleError
from server.web.pages import Action, ErrorPage
from server.web.rendering import ROOT, html

log = structlog.get_logger("hatlab.web")

TITLES = {
    400: "This request cannot be read",
    404: "There is no page at this address",
    405: "This address does not take that kind of request",
    413: "That was too much at once",
    422: "Something in the request does not fit",
    500: "Something went wrong here",
}
ADVICE = {
    404: "Check the link, or open the one from your invitation again.",
    405: "Open the link from your invitation again; your progress is kept.",
    413: "Go back and send less.",
    503: "Nothing was lost. Try again in a few minutes; if this happens again, write to the study's contact "
    "and name the incident below.",
    500: "What you did so far is kept. Reload this page in a moment; if this happens again, write to the "
    "study's contact and name the incident below.",
}
ADMIN_ADVICE = {
    413: "Go back and send less.",
    503: "Nothing was lost. Try again in a moment; the server's log tells more under the incident below.",
    500: "Nothing was changed. Try again in a moment; the server's log tells more under the incident below.",
}
ADMIN_HOME = Action("All studies", "/admin")


def problem(
    status: int,
    title: str,
    detail: str,
    more: Mapping[str, Any] | None = None,
    headers: Mapping[str, str] | None = None,
) -> Response:
    """An answer in application/problem+json; `more` are members of its own."""
    body = {"type": "about:blank", "title": title, "status": status, "detail": detail, **(more or {})}
    text = json.dumps(body, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return Response(
        text,
        status,
        {"cache-control": "no-store", **(headers or {})},
        media_type="application/problem+json",
    )


def wants_json(scope: Scope) -> bool:
    """Whether scripts asked: the addresses of the play API, and the health check."""
    path: str = scope["path"]
    return path == "/healthz" or (path.startswith("/p/") and path.endswith(("/round", "/step", "/events")))


def answer(
    scope: Scope,
    status: int,
    title: str,
    detail: str,
    more: Mapping[str, Any] | None = None,
    headers: Mapping[str, str] | None = None,
) -> Response:
    """The error in the form that the asker can read."""
    if wants_json(scope):
        return problem(status, title, detail, more, headers)
    return html(
        page(scope["path"], status, title, detail, (more or {}).get("incident")), status, headers=headers
    )


def page(path: str, status: int, title: str, detail: str, incident: str | None) -> ErrorPage:
    """The error in sentences, and what to do: participants have a link, experimenters a list of studies."""
    is_admin = path == "/admin" or path.startswith("/admin/")
    advice = (ADMIN_ADVICE if is_admin else ADVICE).get(status, "")
    said = tuple(text for text in (sentence(detail), advice) if text)
    return ErrorPage(status, title, said, incident, ADMIN_HOME if is_admin else None)


def sentence(text: str) -> str:
    """What the command line says after a colon, as a page says it."""
    return text and text[0].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")


async def on_hatlab_error(request: Request, error: Exception) -> Response:
    """Errors that the services raise on purpose."""
    assert isinstance(error, HatlabError)
    if error.status >= 500:
        return incident(request.scope, error, error.status, error.title)
    more = {"view": error.view} if isinstance(error, StaleError) else None
    return answer(request.scope, error.status, error.title, error.detail, more)


async def on_http_error(request: Request, error: Exception) -> Response:
    """Errors of the router and of the body limit."""
    assert isinstance(error, HTTPException)
    title = TITLES.get(error.status_code, str(error.detail))
    detail = str(error.detail) if error.status_code == 413 else ""
    return answer(request.scope, error.status_code, title, detail, headers=error.headers)


async def on_invalid_request(request: Request, error: Exception) -> Response:
    """A body that the schema refuses; names the field, never repeats the value."""
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    field = ".".join(str(part) for part in first["loc"] if part != "body") or "body"
    return answer(request.scope, 422, TITLES[422], f"{field}: {first['msg']}")


def incident(scope: Scope, error: BaseException, status: int = 500, title: str = TITLES[500]) -> Response:
    """Log a bug under a fresh number and answer with that number."""
    number = secrets.token_hex(4)
    log.error(
        "incident",
        incident=number,
        method=scope["method"],
        route=getattr(scope.get("route"), "path", None),
        errors=[type(each).__name__ for each in chain(error)],
        detail=error.detail if isinstance(error, HatlabError) else None,
        frames=frames(error),
    )
    return answer(scope, status, title, "", {"incident": number})


def chain(error: BaseException) -> list[BaseException]:
    """The error and what caused it, last first."""
    found = [error]
    while (cause := found[-1].__cause__ or found[-1].__context__) is not None and cause not in found:
        found.append(cause)
    return found


def frames(error: BaseException) -> list[str]:
    """Where it was raised, outermost first: our own files, and the very place."""
    stack = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in stack if is_own(frame.filename)]
    return [f"{shown(frame.filename)}:{frame.lineno} {frame.name}" for frame in (*own, *stack[-1:])]


def is_own(filename: str) -> bool:
    return Path(filename).is_relative_to(ROOT) and "site-packages" not in filename


def shown(filename: str) -> str:
    """The file below this repository, else its last two parts."""
    path = Path(filename)
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else "/".join(path.parts[-2:])


class Incidents:
    """Turns an error that nobody expected into a 500 answer, inside the security headers."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started = False

        async def send_noted(message: Message) -> None:
            nonlocal started
            started = True
            await send(message)

        try:
            await self.app(scope, receive, send_noted)
        except Exception as error:  # noqa: BLE001 (the last place that can answer)
            response = incident(scope, error)
            if not started:
                await response(scope, receive, send)


def install(app: FastAPI) -> None:
    """Register the handlers."""
    app.add_exception_handler(HatlabError, on_hatlab_error)
    app.add_exception_handler(HTTPException, on_http_error)
    app.add_exception_handler(RequestValidationError, on_invalid_request)
