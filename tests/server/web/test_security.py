"""Headers, content policy and body limit, on a small application around them."""

from collections.abc import AsyncIterator

import pytest
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from server.web.rendering import import_map, import_map_sha256
from server.web.security import BARE_POLICY, BodyLimit, SecurityHeaders, policy
from tests.server.web.client import Client


async def echo(request: Request) -> Response:
    return PlainTextResponse(str(len(await request.body())))


async def own_policy(request: Request) -> Response:
    return PlainTextResponse("", headers={"content-security-policy": "default-src 'self'"})


def small_app(*, behind_https: bool = False) -> Client:
    async def refuse(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        return PlainTextResponse(error.detail, error.status_code, error.headers)

    app = Starlette(
        routes=[Route("/", echo, methods=["GET", "POST"]), Route("/own", own_policy)],
        middleware=[
            Middleware(SecurityHeaders, behind_https=behind_https),
            Middleware(BodyLimit, body_max_bytes=100),
        ],
        exception_handlers={HTTPException: refuse},
    )
    return Client(app)


def test_every_response_carries_the_headers_also_one_that_nothing_answers() -> None:
    for path in ("/", "/nowhere"):
        headers = small_app().get(path).headers
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cross-origin-opener-policy"] == "same-origin"
        assert headers["content-security-policy"] == BARE_POLICY
        assert "strict-transport-security" not in headers


def test_only_a_server_behind_https_asks_browsers_to_stay_there() -> None:
    headers = small_app(behind_https=True).get("/").headers
    assert headers["strict-transport-security"].startswith("max-age=")


def test_a_page_keeps_its_own_policy() -> None:
    response = small_app().get("/own")
    assert response.headers.get_list("content-security-policy") == ["default-src 'self'"]


def test_the_policy_of_pages_allows_no_inline_code_but_the_import_map() -> None:
    directives = dict(part.strip().split(" ", 1) for part in policy(import_map_sha256()).split(";"))
    assert directives["script-src"] == f"'self' 'sha256-{import_map_sha256()}'"
    assert "unsafe" not in policy(import_map_sha256())
    assert directives["object-src"] == directives["base-uri"] == directives["frame-ancestors"] == "'none'"
    assert directives["form-action"] == directives["style-src"] == "'self'"
    assert "<" not in import_map()


def test_frames_and_forms_are_widened_only_by_name() -> None:
    text = policy("x", frames=["https://worker.mturk.com"], forms=["https://www.mturk.com"])
    assert "frame-ancestors https://worker.mturk.com" in text
    assert "form-action 'self' https://www.mturk.com" in text


@pytest.mark.parametrize(("size", "status"), [(0, 200), (100, 200), (101, 413)])
def test_a_body_may_be_as_long_as_the_limit_and_no_longer(size: int, status: int) -> None:
    response = small_app().post("/", content=b"x" * size)
    assert response.status_code == status
    assert response.headers["x-content-type-options"] == "nosniff"


def test_a_body_without_a_length_is_counted_as_it_comes() -> None:
    sent = 0

    async def chunks() -> AsyncIterator[bytes]:
        nonlocal sent
        for _ in range(1_000_000):
            sent += 60
            yield b"x" * 60

    assert small_app().post("/", content=chunks()).status_code == 413
    assert sent == 120
