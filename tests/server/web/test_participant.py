"""The pages of a session, from instructions to the code, and the way back to the marketplace."""

from dataclasses import replace

import pytest

from server.services.lab import Lab
from tests.fakes import definition
from tests.server.services.steps import launch
from tests.server.web.client import Client
from tests.server.web.walk import (
    YES,
    client_of,
    come_in,
    go_on,
    hidden_fields,
    mturk,
    open_round,
    play_all,
    play_block,
    prolific,
)

STUDIES = ["parent-child", "traffic-junction"]


@pytest.fixture(name="client")
def client_of_both_studies(lab: Lab) -> Client:
    for slug in STUDIES:
        launch(lab, definition(slug, trials_per_block=2))
    return client_of(lab)


@pytest.mark.parametrize(("slug", "rounds"), [("parent-child", 4), ("traffic-junction", 2)])
def test_a_person_walks_from_consent_to_the_code(client: Client, slug: str, rounds: int) -> None:
    address = come_in(client, slug)
    last = play_all(client, address)
    assert definition(slug).completion_code in last.text
    assert f"{rounds} of {rounds}" in last.text
    assert client.get(address).text == last.text
    assert open_round(client, address) == {"page": address}
    assert client.get(f"/s/{slug}", params=prolific()).headers["location"] == address


def test_the_code_is_nowhere_before_the_end(client: Client) -> None:
    address = come_in(client, "traffic-junction")
    assert definition("traffic-junction").completion_code not in client.get(address).text
    assert definition("traffic-junction").completion_code not in go_on(client, address).text


def test_a_second_press_of_next_changes_nothing(client: Client) -> None:
    address = come_in(client, "parent-child")
    fields = hidden_fields(client.get(address).text)
    for _ in range(3):
        client.post(f"{address}/next", data=fields)
    page = client.get(address)
    assert "page-data" in page.text
    for odd in ({}, {"page": "complete"}, {"page": "play:2"}, {"page": "play:1"}):
        client.post(f"{address}/next", data=odd)
        assert client.get(address).text == page.text


def test_after_a_block_come_the_instructions_of_the_next(client: Client) -> None:
    address = come_in(client, "parent-child")
    first = client.get(address).text
    go_on(client, address)
    assert play_block(client, address) == 3
    second = client.get(address).text
    assert hidden_fields(second) == {"page": "instructions:2"}
    assert first != second


@pytest.mark.parametrize("key", ["x", "x" * 43, "%00", "%ff%fe", "..%2f..%2fetc", "é" * 20, "x" * 4_000])
def test_an_address_of_nobody_says_what_to_do(client: Client, key: str) -> None:
    for response in (client.get(f"/p/{key}"), client.post(f"/p/{key}/next", data={"page": "x"})):
        assert response.status_code == 404
        assert "from your invitation" in response.text


def test_prolific_people_return_by_a_link_with_the_code(client: Client) -> None:
    last = play_all(client, come_in(client, "traffic-junction"))
    assert "https://app.prolific.com/submissions/complete?cc=CROSSED-OVER" in last.text


def test_workers_submit_a_form_that_the_policy_allows_inside_the_worker_sites_frame(client: Client) -> None:
    address = come_in(client, "traffic-junction", mturk())
    assert (
        "frame-ancestors https://worker.mturk.com" in client.get(address).headers["content-security-policy"]
    )
    last = play_all(client, address)
    assert 'action="https://workersandbox.mturk.com/mturk/externalSubmit"' in last.text
    assert hidden_fields(last.text) == {"assignmentId": "as1", "code": "CROSSED-OVER"}
    assert (
        "form-action 'self' https://www.mturk.com https://workersandbox.mturk.com"
        in (last.headers["content-security-policy"])
    )


def test_a_made_up_submit_host_gets_no_form(client: Client) -> None:
    evil = {**mturk(), "turkSubmitTo": "https://evil.example"}
    last = play_all(client, come_in(client, "traffic-junction", evil))
    assert "evil.example" not in last.text
    assert "CROSSED-OVER" in last.text


def test_one_more_worker_site_counts_only_where_the_settings_name_it(lab: Lab) -> None:
    fake = "http://localhost:8100"
    told = replace(lab, settings=lab.settings.model_copy(update={"mturk_extra_host": fake}))
    launch(lab, definition("traffic-junction", trials_per_block=1))
    with_it, without = client_of(told), client_of(lab)
    worker = {**mturk(), "turkSubmitTo": fake}
    entry = with_it.get("/s/traffic-junction", params=worker)
    assert entry.headers["content-security-policy"].endswith(f"https://workersandbox.mturk.com {fake}")
    address = come_in(with_it, "traffic-junction", worker)
    last = play_all(with_it, address)
    assert f'action="{fake}/mturk/externalSubmit"' in last.text
    assert f"https://workersandbox.mturk.com {fake};" in last.headers["content-security-policy"]
    elsewhere = without.get(address)
    assert fake not in elsewhere.text + elsewhere.headers["content-security-policy"]


def test_a_page_names_no_arm_bundle_or_seed(client: Client) -> None:
    for name in ("ada", "bob", "cyd"):
        fields = {**prolific(name), **YES}
        address = client.post("/s/traffic-junction/consent", data=fields).headers["location"]
        for page in (client.get(address), go_on(client, address)):
            for secret in ("budget", "arm", "seed", "prototype", "bundle"):
                assert secret not in page.text.replace("charm", "")
