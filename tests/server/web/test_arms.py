"""Nothing over HTTP tells arms apart: where the same is shown, pages, bodies and headers are equal bytes."""

from typing import Any

import pytest

from server.services.lab import Lab
from server.storage.database import Database
from tests.fakes import definition, fake_lab
from tests.server.services.steps import launch, person
from tests.server.web.client import Client
from tests.server.web.walk import client_of, come_in, decide, go_on, prolific

SLUG = "traffic-junction"
PRACTICE_STEPS = 4


@pytest.fixture(name="lab")
def quick_lab(sqlite_database: Database) -> Lab:
    lab = fake_lab(sqlite_database)
    for slug in (SLUG, "parent-child"):
        launch(lab, definition(slug))
    return lab


def everything_sent(client: Client, address: str) -> list[Any]:
    """What somebody gets from the instructions to the fourth step of practice, without their own key."""
    responses = [client.get(address), go_on(client, address)]
    responses.append(client.post(f"{address}/round", json={"after": None}))
    view = responses[-1].json()
    for _ in range(PRACTICE_STEPS):
        responses.append(decide(client, address, view, 0))
        view = responses[-1].json()
    key = address.removeprefix("/p/")
    return [(r.status_code, sorted(r.headers.items()), r.text.replace(key, "KEY")) for r in responses]


def test_instructions_page_and_practice_are_the_same_bytes_in_every_arm(lab: Lab) -> None:
    client = client_of(lab)
    sent: dict[str, list[Any]] = {}
    for index in range(12):
        address = come_in(client, SLUG, prolific(f"p{index}"))
        arm = person(lab, address.removeprefix("/p/")).arm
        sent.setdefault(arm, everything_sent(client, address))
    assert len(sent) == 3
    first, *others = sent.values()
    assert all(other == first for other in others)


def test_pages_of_parent_and_child_differ_by_role_and_by_nothing_else(lab: Lab) -> None:
    client = client_of(lab)
    pages: dict[tuple[str, str], list[str]] = {}
    for index in range(16):
        address = come_in(client, "parent-child", prolific(f"p{index}"))
        key = address.removeprefix("/p/")
        who = person(lab, key)
        sent = [client.get(address).text.replace(key, "KEY"), go_on(client, address).text.replace(key, "KEY")]
        assert pages.setdefault((who.arm, who.role_order), sent) == sent
    assert {arm for arm, _ in pages} == {"prototype", "one-hot"}
    for order in ("parent-child", "child-parent"):
        assert pages["prototype", order] == pages["one-hot", order]
