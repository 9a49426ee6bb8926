"""What a hostile participant may try; each attempt is refused clearly, and nothing of it is stored."""

import csv
import io
import threading
import zipfile
from typing import Any

import pytest
from sqlalchemy import func, select

from server.services.export import stream_zip
from server.services.lab import Lab
from server.storage.tables import answer, event, participant
from tests.fakes import another_worker, definition, timing
from tests.server.services.steps import launch, person
from tests.server.web.client import Client
from tests.server.web.walk import (
    DEVICE,
    YES,
    client_of,
    come_in,
    decide,
    go_on,
    hidden_fields,
    mturk,
    open_round,
    play_all,
    play_block,
    prolific,
)

SLUG = "traffic-junction"
QUIZ = [{"key": "goal", "text": "What to do?", "options": ["Cross", "Sleep"], "answer": 1}]


@pytest.fixture(name="client")
def client_of_lab(lab: Lab) -> Client:
    launch(lab, definition(SLUG, trials_per_block=2))
    launch(lab, definition("parent-child", trials_per_block=1, quiz=QUIZ))
    return client_of(lab)


def count(lab: Lab, table: Any) -> int:
    with lab.database.reading() as db:
        return int(db.read(select(func.count()).select_from(table)).scalar_one())


def test_another_participants_key_cannot_be_made_from_ones_own(lab: Lab, client: Client) -> None:
    address = come_in(client, SLUG)
    mine = address.rsplit("/", 1)[1]
    for guess in (mine[:-1] + ("A" if mine[-1] != "A" else "B"), mine[::-1], "0" * 43, person(lab, mine).id):
        assert client.get(f"/p/{guess}").status_code == 404
        assert client.post(f"/p/{guess}/round", json={"after": None}).status_code == 404
        assert client.post(f"/p/{guess}/withdraw", data={"keep": "no"}).status_code == 404
        assert client.post(f"/p/{guess}/answers", data={"form": "quiz:1"}).status_code == 404
    assert person(lab, mine).status == "active"


@pytest.mark.parametrize("key", ["..%2f..%2fadmin", "%00", "'; DROP TABLE participant;--", "a" * 5_000])
def test_odd_keys_are_no_sessions(client: Client, key: str) -> None:
    assert client.get(f"/p/{key}").status_code in {404, 400}


def test_replayed_and_reordered_steps_store_nothing_new(lab: Lab, client: Client) -> None:
    address = come_in(client, SLUG)
    go_on(client, address)
    view = open_round(client, address)
    first = decide(client, address, view, rt_ms=300.0)
    stored = count(lab, event)
    assert decide(client, address, view, rt_ms=300.0).json() == first.json()
    assert decide(client, address, view, action=1 - view["actions"][0], rt_ms=300.0).status_code == 409
    later = {**view, "seq": view["seq"] + 5}
    assert decide(client, address, later).status_code == 409
    other_round = {**view, "round": view["round"] + 1}
    assert decide(client, address, other_round).status_code == 404
    assert count(lab, event) == stored


def test_an_id_that_is_a_formula_never_reaches_a_spreadsheet(lab: Lab, client: Client) -> None:
    worker = "=HYPERLINK(1+1)"
    address = come_in(client, SLUG, mturk(worker))
    play_all(client, address)
    pieces = b"".join(stream_zip(lab, SLUG, ("live",), practice=True))
    with zipfile.ZipFile(io.BytesIO(pieces)) as archive:
        for name in archive.namelist():
            text = archive.read(name).decode()
            assert worker not in text
            if name.endswith(".csv"):
                cells = [cell for row in csv.reader(io.StringIO(text)) for cell in row]
                assert not [cell for cell in cells if cell[:1] in {"=", "@", "\t", "\r"}]


def test_a_body_of_ten_megabytes_is_refused_everywhere(client: Client) -> None:
    address = come_in(client, SLUG)
    huge, form = b"x" * 10_000_000, {"content-type": "application/x-www-form-urlencoded"}
    for path in (f"{address}/step", f"{address}/answers", f"{address}/events", f"/s/{SLUG}/consent"):
        refused = client.post(path, content=huge, headers=form)
        assert refused.status_code == 413, path
    assert client.post("/hooks/prolific", content=huge).status_code in {404, 413}


def test_the_way_back_leads_to_a_known_marketplace_only(client: Client) -> None:
    evil = {**mturk("eve"), "turkSubmitTo": "https://evil.example"}
    address = come_in(client, SLUG, evil)
    last = play_all(client, address)
    assert "evil.example" not in last.text
    assert "evil.example" not in last.headers["content-security-policy"]
    assert client.get("/admin/login?next=https://evil.example").text.count("evil.example") == 0


def test_declining_and_going_back_does_not_let_anybody_in(lab: Lab, client: Client) -> None:
    entry = client.get(f"/s/{SLUG}", params=prolific())
    fields = hidden_fields(entry.text)
    declined = client.post(f"/s/{SLUG}/consent", data={**fields, **DEVICE, "agree": "no"})
    assert "You do not take part" in declined.text
    again = client.post(f"/s/{SLUG}/consent", data={**fields, **YES})
    assert again.status_code == 200
    assert "You do not take part" in again.text
    assert count(lab, participant) == 0


def test_two_tabs_that_race_to_consent_are_one_person(lab: Lab, client: Client) -> None:
    fields = hidden_fields(client.get(f"/s/{SLUG}", params=prolific()).text)
    clients = [client, client_of(another_worker(lab))]
    found: list[str] = []

    def agree(one: Client) -> None:
        done = one.post(f"/s/{SLUG}/consent", data={**fields, **YES})
        found.append(done.headers["location"])

    threads = [threading.Thread(target=agree, args=(one,)) for one in clients]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(found)) == 1
    assert count(lab, participant) == 1


def test_two_tabs_that_race_to_answer_the_quiz_use_one_try(lab: Lab, client: Client) -> None:
    address = come_in(client, "parent-child")
    while "a.goal" not in (page := client.get(address)).text:
        if "round_url" in page.text:
            play_block(client, address)
        else:
            go_on(client, address)
    clients = [client, client_of(another_worker(lab))]
    wrong = {"form": "quiz:1", "attempt": "1", "a.goal": "2"}
    threads = [
        threading.Thread(target=lambda one=one: one.post(f"{address}/answers", data=wrong)) for one in clients
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert count(lab, answer) == 1
    assert person(lab, address.rsplit("/", 1)[1]).status == "active"


def test_a_quiz_cannot_be_skipped_by_asking_for_the_next_page_or_a_round(client: Client) -> None:
    address = come_in(client, "parent-child")
    go_on(client, address)
    play_block(client, address)
    assert "a.goal" in client.get(address).text
    for page in ("quiz:1", "play:1", "complete"):
        client.post(f"{address}/next", data={"page": page})
        assert "a.goal" in client.get(address).text
    assert open_round(client, address) == {"page": address}


def test_after_the_quiz_was_failed_nothing_can_be_played(lab: Lab, client: Client) -> None:
    address = come_in(client, "parent-child")
    go_on(client, address)
    play_block(client, address)
    for attempt in ("1", "2"):
        client.post(f"{address}/answers", data={"form": "quiz:1", "attempt": attempt, "a.goal": "2"})
    assert person(lab, address.rsplit("/", 1)[1]).status == "screened_out"
    stored = count(lab, event)
    assert open_round(client, address) == {"page": address}
    body = {"round": 1, "seq": 9, "action": 0, "timing": timing()}
    refused = client.post(f"{address}/step", json=body)
    assert refused.status_code == 403
    assert "load its page again" in refused.json()["detail"]
    assert count(lab, event) == stored
    page = client.get(address).text
    assert "no rejection" in page
    client.post(f"{address}/answers", data={"form": "quiz:1", "attempt": "3", "a.goal": "1"})
    assert person(lab, address.rsplit("/", 1)[1]).status == "screened_out"
