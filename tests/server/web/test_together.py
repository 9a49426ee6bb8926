"""Many people at the same time: a restart, and people who begin in the same instant."""

from datetime import UTC, datetime
from typing import Any

import pytest
from sqlalchemy import select

from server.services.lab import Lab
from server.services.verify import verify
from server.storage.database import Database
from server.storage.tables import event, trial
from tests.fakes import FakeClock, another_worker, definition, fake_lab
from tests.server.services.steps import launch
from tests.server.web.walk import client_of, come_in, decide, go_on, open_round, prolific

SLUG = "traffic-junction"
PEOPLE = 40


@pytest.fixture
def lab(sqlite_database: Database) -> Lab:
    made = fake_lab(sqlite_database, clock=FakeClock(0))
    launch(made, definition(SLUG, trials_per_block=1, practice_rounds=0))
    return made


def begun(lab: Lab, names: list[str]) -> dict[str, Any]:
    """Everybody's first round, open; by the address of the session."""
    client = client_of(lab)
    addresses = [come_in(client, SLUG, prolific(name)) for name in names]
    for address in addresses:
        go_on(client, address)
    return {address: open_round(client, address) for address in addresses}


def test_forty_people_in_the_middle_of_a_round_go_on_after_a_restart(lab: Lab) -> None:
    before = begun(lab, [f"person-{number}" for number in range(PEOPLE)])
    client = client_of(lab)
    shown = {address: decide(client, address, view).json() for address, view in before.items()}
    restarted = another_worker(lab)
    client = client_of(restarted)
    for address, view in shown.items():
        opened = open_round(client, address)
        assert opened | view == opened
        assert decide(client, address, opened).json()["seq"] == 2
    assert verify(restarted, SLUG).clean


def test_four_people_of_the_same_instant_have_rounds_of_their_own(lab: Lab) -> None:
    assert lab.now() == lab.now() == datetime(2026, 11, 24, 12, tzinfo=UTC)
    views = begun(lab, ["ada", "grace", "mary", "joan"])
    client = client_of(lab)
    for address, view in views.items():
        decide(client, address, view)
    with lab.database.reading() as db:
        whose = {str(row.id): str(row.participant_id) for row in db.read(select(trial))}
        stored = [(str(row.trial_id), int(row.seq)) for row in db.read(select(event))]
    assert len(whose) == len(set(whose.values())) == len(views)
    assert sorted(stored) == sorted((name, seq) for name in whose for seq in (0, 1))
