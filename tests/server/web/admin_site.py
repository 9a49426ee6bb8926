"""An experimenter at the admin pages: signs in once, sends forms as the pages do."""

import html
import re
from typing import Any

import httpx
from fastapi import FastAPI

from server.services import accounts, studies
from server.services.lab import Lab
from server.web import admin, errors
from server.web.security import BodyLimit, SecurityHeaders
from tests.server.web.client import Client

USERNAME, PASSWORD = "admin", "correct horse battery"
FIELD = re.compile(
    r"<(input|textarea|select|button)\b([^>]*)>(.*?)(?=<(?:input|textarea|select|button|/form)\b)", re.DOTALL
)
ATTRIBUTE = re.compile(r'([a-z-]+)(?:="([^"]*)")?')
OPTION = re.compile(r'<option value="([^"]*)"[^>]* selected')


def admin_app(lab: Lab) -> FastAPI:
    """Only the admin's part of the server."""
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    app.state.lab = lab
    app.add_middleware(BodyLimit, body_max_bytes=lab.settings.body_max_bytes)
    app.add_middleware(SecurityHeaders, behind_https=False)
    errors.install(app)
    app.include_router(admin.router)
    return app


def with_account(lab: Lab) -> Lab:
    with lab.database.writing() as db:
        accounts.create_admin(db, USERNAME, PASSWORD)
        studies.ensure_demo_studies(db, lab)
    return lab


def fields_of(page: str, form: str | None = None) -> dict[str, str]:
    """What a browser would send of the form that posts to `form`: values as they stand, no button."""
    start = page.index(f'action="{form}"') if form else page.index("data-build")
    text = page[start : page.index("</form>", start) + 7]
    found: dict[str, str] = {}
    for tag, raw, inner in FIELD.findall(text):
        given = dict(ATTRIBUTE.findall(raw))
        name = given.get("name")
        if not name or tag == "button":
            continue
        if given.get("type") in {"checkbox", "radio"} and "checked" not in given:
            continue
        value = given.get("value", "")
        if tag == "textarea":
            value = inner[: inner.index("</textarea>")].removeprefix("\n")
        if tag == "select":
            chosen = OPTION.search(inner)
            value = chosen[1] if chosen else ""
        found[name] = html.unescape(value)
    return found


class Experimenter:
    """A browser with a session."""

    def __init__(self, lab: Lab, app: FastAPI | None = None) -> None:
        self.lab = lab
        self.client = Client(app or admin_app(lab))

    def sign_in(self, username: str = USERNAME, password: str = PASSWORD, **more: str) -> httpx.Response:
        page = self.client.get("/admin/login")
        fields = fields_of(page.text, "/admin/login")
        return self.client.post(
            "/admin/login", data=fields | {"username": username, "password": password} | more
        )

    @property
    def csrf(self) -> str:
        return fields_of(self.get("/admin").text, "/admin/logout")["csrf"]

    def get(self, url: str, **options: Any) -> httpx.Response:
        return self.client.get(url, **options)

    def post(self, url: str, **fields: str) -> httpx.Response:
        return self.client.post(url, data={"csrf": self.csrf} | fields)

    def save(self, slug: str, changes: dict[str, str] | None = None, action: str = "save") -> httpx.Response:
        """Open the builder, change some fields, press a button."""
        url = f"/admin/studies/{slug}"
        fields = fields_of(self.get(url).text) | (changes or {}) | {"action": action}
        return self.client.post(url, data=fields)

    def confirm(self, slug: str, page: str) -> httpx.Response:
        """Open the page that asks, and say yes."""
        url = f"/admin/studies/{slug}/{page}"
        return self.client.post(url, data=fields_of(self.get(url).text, url))
