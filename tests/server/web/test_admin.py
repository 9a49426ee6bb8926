"""Signing in and out; nobody else gets in; forms of strangers are refused."""

import re
import shutil
from collections.abc import Iterator
from dataclasses import fields as dataclass_fields
from pathlib import Path

import pytest
from fastapi.routing import iter_route_contexts

from server.app import create_app
from server.services.lab import Lab
from server.storage.database import Database
from server.web import admin, admin_pages
from server.web.admin import too_many
from server.web.admin_access import safe_target
from tests.fakes import FakeClock, fake_lab
from tests.server.web.admin_site import PASSWORD, Experimenter, admin_app, with_account
from tests.server.web.client import Client
from tests.server.web.test_rendering import names_used

PAGES = [
    admin_pages.LoginPage,
    admin_pages.StudiesPage,
    admin_pages.NewStudyPage,
    admin_pages.BuildPage,
    admin_pages.ConfirmPage,
    admin_pages.MonitorPage,
    admin_pages.AgentsPage,
    admin_pages.AgentPage,
    admin_pages.NoticePage,
]
EVERY_METHOD = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")
LOGIN = "/admin/login"
# Everybody may ask for these, with what the address itself proves (a key) or no secret at all.
FOR_PARTICIPANTS = ("/hooks/", "/s/{slug}", "/p/{key}", "/healthz")
ROUTES = sorted(
    (method, str(route.path))
    for route in iter_route_contexts(admin.router.routes)
    for method in route.methods or ()
    if route.path != LOGIN
)
FORMS = [path for method, path in ROUTES if method == "POST"]


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


@pytest.fixture
def site(sqlite_database: Database, clock: FakeClock) -> Lab:
    return with_account(fake_lab(sqlite_database, clock=clock))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.__name__)
def test_a_template_uses_only_what_its_page_gives(page: type) -> None:
    imported = {"ui"}  # the macros; Jinja does not see that blocks inherit an import
    assert names_used(page.template) - imported <= {each.name for each in dataclass_fields(page)}


@pytest.fixture(scope="module")
def untouched(migrated_sqlite: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """One site for the tests in which nothing may change."""
    path = tmp_path_factory.mktemp("untouched") / "hatlab.sqlite3"
    shutil.copy(migrated_sqlite, path)
    database = Database(f"sqlite:///{path}")
    yield with_account(fake_lab(database))
    database.close()


@pytest.fixture(scope="module")
def signed_in(untouched: Lab) -> Experimenter:
    person = Experimenter(untouched)
    person.sign_in()
    return person


def url_of(path: str) -> str:
    return (
        path.replace("{slug}", "parent-child")
        .replace("{number}", "1")
        .replace("{folder}/{name}", "parent_child/prototype-9")
    )


@pytest.mark.parametrize(("method", "path"), ROUTES)
def test_no_admin_page_opens_without_signing_in(untouched: Lab, method: str, path: str) -> None:
    for headers in ({}, {"cookie": "hatlab-admin=made-up"}):
        answer = Client(admin_app(untouched)).request(method, url_of(path), headers=headers)
        assert answer.status_code == 303
        assert answer.headers["location"].startswith("/admin/login")
        assert "Find the lost child" not in answer.text


def test_no_method_of_any_address_of_the_whole_server_opens_the_admin(untouched: Lab) -> None:
    app = create_app(untouched)
    paths = {str(route.path) for route in iter_route_contexts(app.routes) if route.path != "/static"}
    assert {path for path in paths if not path.startswith(FOR_PARTICIPANTS)} == {
        "/",
        LOGIN,
        *(path for _, path in ROUTES),
    }
    stranger = Client(app)
    for path in sorted({path for _, path in ROUTES}):
        for method in EVERY_METHOD:
            answer = stranger.request(method, url_of(path))
            assert answer.status_code in {303, 405}, (method, path)
            assert "Find the lost child" not in answer.text


def test_a_stranger_is_sent_back_to_the_page_after_signing_in(site: Lab) -> None:
    person = Experimenter(site)
    sent = person.get("/admin/agents").headers["location"]
    assert sent == "/admin/login?next=/admin/agents"
    answer = person.sign_in(next="/admin/agents")
    assert (answer.status_code, answer.headers["location"]) == (303, "/admin/agents")
    assert person.get("/admin/agents").status_code == 200


@pytest.mark.parametrize(
    "target",
    [
        "https://evil.example",
        "//evil.example",
        "/s/x",
        "/administrator",
        "/admin\\@evil.example",
        "/admin/\n",
        "/admin/../p/somebody",
    ],
)
def test_signing_in_never_leads_to_another_site(target: str) -> None:
    assert safe_target(target) == "/admin"


def test_the_session_cookie_is_kept_from_scripts_and_other_sites(site: Lab) -> None:
    cookie = Experimenter(site).sign_in().headers.get_list("set-cookie")[0].lower()
    assert cookie.startswith("hatlab-admin=")
    for wanted in ("httponly", "samesite=strict", "path=/admin", "max-age="):
        assert wanted in cookie
    assert "secure" not in cookie


def test_over_https_the_session_cookie_never_travels_without_it(site: Lab) -> None:
    person = Experimenter(site)
    person.client = Client(admin_app(site), base_url="https://hatlab.test")
    assert "secure" in person.sign_in().headers.get_list("set-cookie")[0].lower()


def test_a_wrong_password_says_so_and_keeps_the_username(site: Lab) -> None:
    answer = Experimenter(site).sign_in("ada", "guess")
    assert answer.status_code == 401
    assert "do not belong together" in answer.text
    assert 'value="ada"' in answer.text
    assert "guess" not in answer.text


def test_after_five_wrong_passwords_the_page_says_how_long_to_wait(site: Lab, clock: FakeClock) -> None:
    person = Experimenter(site)
    for _ in range(5):
        assert person.sign_in(password="wrong").status_code == 401
    answer = person.sign_in()
    assert answer.status_code == 429
    assert "Try again in 15 minutes" in answer.text
    assert 800 < int(answer.headers["retry-after"]) <= 900
    clock.now = clock.now.replace(minute=clock.now.minute + 16)
    assert person.sign_in().status_code == 303


def test_the_wait_is_told_in_seconds_near_its_end() -> None:
    assert too_many(1) == "Too many attempts. Try again in 1 second."
    assert too_many(59) == "Too many attempts. Try again in 59 seconds."
    assert too_many(60) == "Too many attempts. Try again in 1 minute."
    assert too_many(61) == "Too many attempts. Try again in 2 minutes."


def test_signing_out_ends_the_session_and_not_only_the_cookie(site: Lab) -> None:
    person = Experimenter(site)
    person.sign_in()
    key = person.client.cookies["hatlab-admin"]
    assert person.post("/admin/logout").headers["location"] == "/admin/login"
    thief = Client(admin_app(site))
    assert thief.get("/admin", headers={"cookie": f"hatlab-admin={key}"}).status_code == 303


def test_a_session_ends_after_twelve_hours(site: Lab, clock: FakeClock) -> None:
    person = Experimenter(site)
    person.sign_in()
    assert person.get("/admin").status_code == 200
    clock.now = clock.now.replace(day=25)
    assert person.get("/admin").status_code == 303


@pytest.mark.parametrize("path", FORMS)
def test_a_form_without_the_secret_of_the_session_changes_nothing(signed_in: Experimenter, path: str) -> None:
    url = url_of(path)
    for fields in ({}, {"csrf": ""}, {"csrf": "made-up"}, {"csrf": "ü"}):
        answer = signed_in.client.post(url, data={"source": "template:parent-child", "title": "x"} | fields)
        assert answer.status_code == 403, url
        assert "out of date" in answer.text
    assert signed_in.get("/admin").text.count("<tr>") == 3


def test_the_login_form_of_another_browser_is_refused(site: Lab) -> None:
    mine, other = Experimenter(site), Experimenter(site)
    page = other.get("/admin/login").text
    signed = re.search(r'name="csrf" value="([^"]+)"', page)
    assert signed
    mine.get("/admin/login")
    for csrf in (signed[1], "", "made.up"):
        answer = mine.client.post(
            "/admin/login", data={"csrf": csrf, "username": "admin", "password": PASSWORD}
        )
        assert answer.status_code == 403
        assert "hatlab-admin" not in mine.client.cookies


def test_admin_pages_are_in_no_cache_and_in_no_frame(site: Lab) -> None:
    person = Experimenter(site)
    person.sign_in()
    for url in ("/admin/login", "/admin", "/admin/studies/parent-child", "/admin/agents"):
        answer = person.get(url)
        assert answer.status_code == 200
        assert answer.headers["cache-control"] == "no-store"
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
        assert not re.search(r"\sstyle=|\son[a-z]+=|javascript:", answer.text)
