"""Rounds and steps over HTTP: retries, stale writers, bodies that do not fit, equal bytes for equal views."""

from typing import Any

import pytest

from server.services.lab import Lab
from server.storage.database import Database
from tests.fakes import definition, fake_lab, timing
from tests.server.services.steps import come_in, launch, playing
from tests.server.web.client import Client
from tests.server.web.walk import client_of, decide, open_round

SLUG = "traffic-junction"


@pytest.fixture(name="lab")
def quick_lab(sqlite_database: Database) -> Lab:
    return fake_lab(sqlite_database)


@pytest.fixture(name="client")
def client_of_the_lab(lab: Lab) -> Client:
    return client_of(lab)


@pytest.fixture(name="address")
def address_of_somebody_playing(lab: Lab) -> str:
    return f"/p/{playing(lab, SLUG)}"


def test_a_step_sent_again_gets_the_same_bytes(client: Client, address: str) -> None:
    view = open_round(client, address)
    first, again = decide(client, address, view), decide(client, address, view)
    assert first.status_code == again.status_code == 200
    assert first.content == again.content
    assert first.headers == again.headers
    assert first.headers["cache-control"] == "no-store"
    assert first.json()["seq"] == 1


def test_another_answer_to_a_taken_step_is_told_to_read_again(client: Client, address: str) -> None:
    view = open_round(client, address)
    now = decide(client, address, view, view["actions"][0]).json()
    stale = decide(client, address, view, view["actions"][1])
    assert stale.status_code == 409
    assert stale.headers["content-type"] == "application/problem+json"
    assert stale.json()["view"] == {name: now[name] for name in now}


def test_a_reload_opens_the_same_round_at_the_same_step(client: Client, address: str) -> None:
    view = open_round(client, address)
    now = decide(client, address, view).json()
    again = open_round(client, address)
    assert {name: again[name] for name in now} == now


def spoilt(**changes: Any) -> dict[str, Any]:
    return {"round": 1, "seq": 1, "action": 0, "timing": timing(), **changes}


@pytest.mark.parametrize(
    "body",
    [
        spoilt(action=7),
        spoilt(action=-1),
        spoilt(action="0"),
        spoilt(action=True),
        spoilt(action=10**30),
        spoilt(seq=1.0),
        spoilt(extra=1),
        spoilt(timing={}),
        spoilt(timing={**timing(), "extra": 1}),
        spoilt(timing=timing(hidden=1)),
        spoilt(timing=timing(input="mouse")),
        spoilt(timing=timing(onset_ms=-1)),
        {**spoilt(), "timing": None},
        [],
    ],
)
def test_a_body_that_no_page_sends_is_refused_and_changes_nothing(
    client: Client, address: str, body: Any
) -> None:
    view = open_round(client, address)
    refused = client.post(f"{address}/step", json=body)
    assert refused.status_code == 422
    assert refused.json()["detail"]
    assert open_round(client, address) == view


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e400"])
def test_a_time_that_is_no_number_is_refused(client: Client, address: str, number: str) -> None:
    open_round(client, address)
    text = f'{{"round":1,"seq":1,"action":0,"timing":{{"onset_ms":{number}}}}}'
    headers = {"content-type": "application/json"}
    assert client.post(f"{address}/step", content=text, headers=headers).status_code == 422


@pytest.mark.parametrize("text", ["[" * 200_000, "1" * 100_000, "\udcff", '{"after":' + "9" * 5_000 + "}"])
def test_a_body_made_to_hurt_the_parser_is_refused(client: Client, address: str, text: str) -> None:
    content = text.encode("utf-8", "surrogateescape")
    headers = {"content-type": "application/json"}
    response = client.post(f"{address}/round", content=content, headers=headers)
    assert response.status_code in {400, 422}
    assert response.headers["content-type"] == "application/problem+json"


def test_a_round_that_was_not_opened_is_not_found(client: Client, address: str) -> None:
    response = client.post(f"{address}/step", json=spoilt(round=9))
    assert response.status_code == 404
    assert response.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("key", ["x" * 43, "%00"])
def test_nobodys_session_is_a_problem_and_not_a_page(client: Client, key: str) -> None:
    for path, body in (("round", {"after": None}), ("step", spoilt())):
        response = client.post(f"/p/{key}/{path}", json=body)
        assert response.status_code == 404
        assert response.headers["content-type"] == "application/problem+json"


def test_scripts_on_the_wrong_page_are_sent_to_the_right_one(lab: Lab, client: Client) -> None:
    launch(lab, definition(SLUG))
    address = f"/p/{come_in(lab, SLUG)}"
    assert open_round(client, address) == {"page": address}


def test_a_body_over_the_limit_is_a_problem(client: Client, address: str) -> None:
    response = client.post(f"{address}/step", content=b" " * 300_000)
    assert response.status_code == 413
    assert response.headers["content-type"] == "application/problem+json"
