"""Webhooks: believed only with the marketplace's signature, and taken once."""

import json
import time
from dataclasses import replace

import pytest
from pydantic import SecretStr

from server.recruitment.prolific_webhook import EVENT, signature
from server.services.lab import Lab
from server.storage import postings, studies
from server.storage.database import Database
from tests.fakes import definition, fake_lab
from tests.server.services.steps import launch, person
from tests.server.web.client import Client
from tests.server.web.walk import client_of, come_in

SECRET = SecretStr("hook-secret")
SLUG = "traffic-junction"


@pytest.fixture(name="lab")
def lab_with_a_posting(sqlite_database: Database) -> Lab:
    lab = fake_lab(sqlite_database)
    lab = replace(lab, settings=lab.settings.model_copy(update={"prolific_webhook_secret": SECRET}))
    launch(lab, definition(SLUG))
    with lab.database.writing() as db:
        row = studies.by_slug(db, SLUG)
        assert row is not None
        postings.add(db, row.id, "prolific", "there-1", "active", 3, '{"mode":"live"}', lab.now_utc())
    return lab


@pytest.fixture(name="client")
def client_of_lab(lab: Lab) -> Client:
    return client_of(lab)


def message(
    status: str, event_id: str = "e1", secret: SecretStr = SECRET, age_s: float = 0
) -> dict[str, object]:
    """What Prolific would send about Ada's submission."""
    body = json.dumps(
        {"event_type": EVENT, "resource_id": "sub-ada", "participant_id": "ada", "status": status}
    ).encode()
    stamp = str(int(time.time() - age_s))
    headers = {
        "x-prolific-request-timestamp": stamp,
        "x-prolific-request-signature": signature(secret, stamp, body),
        "x-event-id": event_id,
    }
    return {"content": body, "headers": headers}


def status_of(lab: Lab, address: str) -> str:
    return person(lab, address.rsplit("/", 1)[1]).status


def test_a_return_that_is_told_frees_the_place(lab: Lab, client: Client) -> None:
    address = come_in(client, SLUG)
    assert client.post("/hooks/prolific", **message("RETURNED")).status_code == 200
    assert status_of(lab, address) == "returned"
    page = client.get(address)
    assert page.status_code == 200
    assert "returned your place" in page.text
    assert client.post("/hooks/prolific", **message("RETURNED")).status_code == 200


def test_a_forged_message_is_refused_and_changes_nothing(lab: Lab, client: Client) -> None:
    address = come_in(client, SLUG)
    forged = message("RETURNED", secret=SecretStr("guessed"))
    refused = client.post("/hooks/prolific", **forged)
    assert refused.status_code == 403
    assert refused.headers["content-type"] == "application/problem+json"
    assert "hook-secret" not in refused.text
    assert status_of(lab, address) == "active"


def test_an_old_message_that_somebody_recorded_is_refused(lab: Lab, client: Client) -> None:
    address = come_in(client, SLUG)
    assert client.post("/hooks/prolific", **message("RETURNED", age_s=3_600)).status_code == 403
    assert status_of(lab, address) == "active"


def test_a_changed_body_under_a_good_signature_is_refused(lab: Lab, client: Client) -> None:
    address = come_in(client, SLUG)
    sent = message("ACTIVE")
    sent["content"] = bytes(sent["content"]).replace(b"ACTIVE", b"RETURNED")  # type: ignore[call-overload]
    assert client.post("/hooks/prolific", **sent).status_code == 403
    assert status_of(lab, address) == "active"


def test_without_a_secret_nothing_is_believed(sqlite_database: Database) -> None:
    client = client_of(fake_lab(sqlite_database))
    assert client.post("/hooks/prolific", **message("RETURNED")).status_code == 404


def test_a_state_that_nobody_knows_is_said_and_is_no_fault_of_the_servers(lab: Lab, client: Client) -> None:
    address = come_in(client, SLUG)
    answer = client.post("/hooks/prolific", **message("ABDUCTED"))
    assert answer.status_code == 422
    assert "does not know" in answer.json()["detail"]
    assert status_of(lab, address) == "active"
