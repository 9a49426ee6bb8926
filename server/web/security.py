"""What keeps strangers out of pages: response headers, the content policy, and a limit on request bodies."""

from collections.abc import Iterable

from starlette.datastructures import MutableHeaders
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",  # session keys stand in paths
    "permissions-policy": "camera=(), microphone=(), geolocation=(), payment=(), usb=()",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}
HSTS = "max-age=31536000"
BARE_POLICY = "default-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"


def policy(import_map_sha256: str, *, frames: Iterable[str] = (), forms: Iterable[str] = ()) -> str:
    """The Content-Security-Policy of a page: scripts and styles only from this server's files.

    The one inline script is the import map, allowed by its hash. `frames` may embed the page; `forms` may be
    posted to.
    """
    ancestors = " ".join(frames) or "'none'"
    targets = " ".join(("'self'", *forms))
    return (
        f"default-src 'self'; script-src 'self' 'sha256-{import_map_sha256}'; style-src 'self'; "
        f"img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action {targets}; "
        f"frame-ancestors {ancestors}"
    )


class SecurityHeaders:
    """Puts the headers on every response; a response that brings its own content policy keeps it."""

    def __init__(self, app: ASGIApp, *, behind_https: bool) -> None:
        self.app = app
        headers = {**HEADERS, **({"strict-transport-security": HSTS} if behind_https else {})}
        self.raw = [(name.encode(), value.encode()) for name, value in headers.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message.setdefault("headers", [])
                message["headers"] = [*message["headers"], *self.raw]
                MutableHeaders(scope=message).setdefault("content-security-policy", BARE_POLICY)
            await send(message)

        await self.app(scope, receive, send_guarded)


class BodyLimit:
    """Refuses a body of more than `body_max_bytes`: by its announced length, else as soon as it is longer."""

    def __init__(self, app: ASGIApp, *, body_max_bytes: int) -> None:
        self.app = app
        self.body_max_bytes = body_max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] in {"GET", "HEAD"}:
            await self.app(scope, receive, send)
            return
        announced = announced_bytes(scope)
        seen = 0

        async def receive_limited() -> Message:
            nonlocal seen
            if announced > self.body_max_bytes:
                raise too_large(self.body_max_bytes)
            message = await receive()
            seen += len(message.get("body", b""))
            if seen > self.body_max_bytes:
                raise too_large(self.body_max_bytes)
            return message

        await self.app(scope, receive_limited, send)


def announced_bytes(scope: Scope) -> int:
    """The request's Content-Length; 0 where there is none (then the body is counted as it comes)."""
    for name, value in scope["headers"]:
        if name == b"content-length" and value.isdigit():
            return int(value)
    return 0


def too_large(body_max_bytes: int) -> HTTPException:
    """The refusal; the connection closes, so that the rest need not be read."""
    detail = f"The request is larger than {body_max_bytes} bytes."
    return HTTPException(413, detail, headers={"connection": "close"})
