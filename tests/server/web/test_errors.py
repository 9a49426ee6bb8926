"""Errors as pages, as problem JSON, and as incidents whose log says nothing about people."""

import json
from collections.abc import Iterator

import pytest
import structlog
from fastapi import FastAPI
from fastapi.middleware import Middleware
from structlog.testing import LogCapture

from server.domain.errors import CorruptError, NotFoundError, StaleError
from server.web import errors
from server.web.schemas import RoundBody
from server.web.security import BodyLimit, SecurityHeaders
from tests.server.web.client import Client

KEY = "kKkKkKkKkKkKkKkKkKkKkKkKkKkKkKkKkKkKkKkKkKk"


@pytest.fixture(name="log")
def captured_log() -> Iterator[LogCapture]:
    capture = LogCapture()
    before = structlog.get_config()
    structlog.configure(processors=[capture])
    yield capture
    structlog.configure(**before)


@pytest.fixture(name="client")
def client_of_a_failing_server() -> Client:
    app = FastAPI(
        middleware=[
            Middleware(SecurityHeaders, behind_https=False),
            Middleware(errors.Incidents),
            Middleware(BodyLimit, body_max_bytes=1_000),
        ]
    )
    errors.install(app)

    @app.get("/p/{key}")
    def page(key: str) -> None:
        raise NotFoundError("there is no such session")

    @app.post("/p/{key}/round")
    def stale(key: str, body: RoundBody) -> None:
        raise StaleError("this step was already taken", {"seq": 3})

    @app.get("/admin/studies/{slug}")
    def study(slug: str) -> None:
        raise NotFoundError(f"there is no study {slug}")

    @app.get("/admin/crash")
    def admin_crash() -> None:
        raise RuntimeError

    @app.get("/bug/{key}")
    def bug(key: str) -> None:
        try:
            int(key)
        except ValueError as cause:
            raise CorruptError("round 3 has no start") from cause

    @app.get("/crash/{key}")
    def crash(key: str) -> None:
        raise RuntimeError(key)

    return Client(app)


def test_people_get_a_page_that_says_what_to_do(client: Client) -> None:
    response = client.get(f"/p/{KEY}")
    assert response.status_code == 404
    assert response.headers["content-type"].startswith("text/html")
    assert "<p>There is no such session.</p>" in response.text
    assert "open the one from your invitation" in response.text


@pytest.mark.parametrize("path", ["/admin/studies/nothing", "/admin/nowhere", "/admin/crash"])
def test_experimenters_are_told_of_their_studies_not_of_an_invitation(client: Client, path: str) -> None:
    told = client.get(path).text
    assert 'href="/admin">All studies</a>' in told
    assert "invitation" not in told
    assert "study&#39;s contact" not in told


def test_scripts_get_problem_json_with_the_current_view(client: Client) -> None:
    response = client.post(f"/p/{KEY}/round", json={"after": None})
    assert response.status_code == 409
    assert response.headers["content-type"] == "application/problem+json"
    assert response.headers["cache-control"] == "no-store"
    assert response.json() == {
        "type": "about:blank",
        "title": "Already answered",
        "status": 409,
        "detail": "this step was already taken",
        "view": {"seq": 3},
    }


@pytest.mark.parametrize(
    "body", ["", "null", "[]", '{"after":"1"}', '{"after":1.5}', '{"after":1,"x":2}', '{"after":-1}', "{"]
)
def test_a_body_that_does_not_fit_is_told_which_field(client: Client, body: str) -> None:
    response = client.post(f"/p/{KEY}/round", content=body, headers={"content-type": "application/json"})
    assert response.status_code == 422
    assert response.json()["detail"]
    assert KEY not in response.text


def test_a_large_body_is_a_problem_too(client: Client) -> None:
    response = client.post(f"/p/{KEY}/round", content="x" * 2_000)
    assert response.status_code == 413
    assert response.json()["detail"] == "The request is larger than 1000 bytes."
    assert response.headers["connection"] == "close"


@pytest.mark.parametrize("path", ["/nowhere", "/p/"])
def test_an_unknown_address_has_a_page(client: Client, path: str) -> None:
    response = client.get(path)
    assert response.status_code == 404
    assert "There is no page at this address" in response.text
    assert response.headers["x-content-type-options"] == "nosniff"


def test_a_wrong_method_has_a_page_that_names_the_right_one(client: Client) -> None:
    response = client.post(f"/p/{KEY}")
    assert response.status_code == 405
    assert response.headers["allow"] == "GET"
    assert "your progress is kept" in response.text


@pytest.mark.parametrize(
    ("path", "named", "detail"),
    [("bug", ["CorruptError", "ValueError"], "round 3 has no start"), ("crash", ["RuntimeError"], None)],
)
def test_a_bug_gets_a_number_and_the_log_no_key(
    client: Client, log: LogCapture, path: str, named: list[str], detail: str | None
) -> None:
    response = client.get(f"/{path}/{KEY}")
    assert response.status_code == 500
    assert response.headers["x-content-type-options"] == "nosniff"
    entry = log.entries[0]
    assert entry["incident"] in response.text
    assert entry["route"] == f"/{path}/{{key}}"
    assert entry["errors"] == named
    assert entry["detail"] == detail
    assert "test_errors.py" in entry["frames"][-1]
    assert KEY not in json.dumps(log.entries)
    assert KEY not in response.text
