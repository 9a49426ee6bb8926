"""What tests of the pages do again and again, over HTTP as a browser would."""

import html
import re
from typing import Any

import httpx

from server.app import create_app
from server.services.lab import Lab
from tests.fakes import timing
from tests.server.web.client import Client

DEVICE = {"device": "desktop", "browser": "Firefox 140", "viewport": "1280x720"}
YES = {"agree": "yes", "read": "yes", **DEVICE}


def client_of(lab: Lab, **options: Any) -> Client:
    return Client(create_app(lab), **options)


def prolific(name: str = "ada") -> dict[str, str]:
    return {"PROLIFIC_PID": name, "STUDY_ID": "s1", "SESSION_ID": f"sub-{name}"}


def mturk(name: str = "ada", assignment: str = "as1") -> dict[str, str]:
    host = "https://workersandbox.mturk.com"
    return {"workerId": name, "assignmentId": assignment, "hitId": "h1", "turkSubmitTo": host}


def come_in(client: Client, slug: str, params: dict[str, str] | None = None) -> str:
    """Consent with everything that the form holds; the address of the session."""
    entry = client.get(f"/s/{slug}", params=prolific() if params is None else params)
    assert entry.status_code == 200, entry.text
    done = client.post(f"/s/{slug}/consent", data={**hidden_fields(entry.text), **YES})
    assert done.status_code == 303, done.text
    return done.headers["location"]


def hidden_fields(text: str) -> dict[str, str]:
    """The hidden fields of the only form that has any."""
    found = re.findall(r'<input type="hidden" name="([^"]*)" value="([^"]*)">', text)
    return {html.unescape(name): html.unescape(value) for name, value in found}


def go_on(client: Client, address: str) -> httpx.Response:
    """Press the button of the instructions; the page that follows."""
    fields = hidden_fields(client.get(address).text)
    done = client.post(f"{address}/next", data=fields)
    assert done.status_code == 303
    assert done.headers["location"] == address
    return client.get(address)


def open_round(client: Client, address: str, after: int | None = None) -> Any:
    response = client.post(f"{address}/round", json={"after": after})
    assert response.status_code == 200, response.text
    return response.json()


def decide(
    client: Client, address: str, view: Any, action: int | None = None, **changes: Any
) -> httpx.Response:
    chosen = view["actions"][0] if action is None else action
    body = {"round": view["round"], "seq": view["seq"] + 1, "action": chosen, "timing": timing(**changes)}
    return client.post(f"{address}/step", json=body)


def play_block(client: Client, address: str) -> int:
    """Every round of the present block; how many there were."""
    rounds, after = 0, None
    while True:
        view = open_round(client, address, after)
        if "page" in view:
            assert view["page"] == address
            return rounds
        while view["over"] is None:
            view = decide(client, address, view).json()
        rounds, after = rounds + 1, view["round"]


def play_all(client: Client, address: str) -> httpx.Response:
    """From the first instructions to the last page."""
    while "page-data" in (page := go_on(client, address)).text:
        play_block(client, address)
    return page
