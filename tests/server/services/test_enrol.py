"""Coming in: one person per name, no data without consent, a page for every state, balanced arms."""

import threading
from collections import Counter
from datetime import timedelta
from typing import Any

import pytest
from itsdangerous import TimestampSigner
from sqlalchemy import func, select

from server.domain import allocation, canonical
from server.domain.errors import BadInputError, NotFoundError
from server.services import enrol
from server.services.enrol import DeviceReport, Enrolled, Entry, Refused
from server.services.lab import Lab
from server.storage import enrolments, participants, refusals, studies
from server.storage.database import Database
from server.storage.tables import metadata
from tests.fakes import FakeClock, definition, fake_lab
from tests.server.services.steps import DESKTOP, come_in, go_on, launch, person, play_all, prolific

PREVIEW = {"assignmentId": "ASSIGNMENT_ID_NOT_AVAILABLE", "hitId": "h"}


def enter(lab: Lab, slug: str, params: dict[str, str], robot: str | None = None) -> Entry:
    with lab.database.reading() as db:
        return enrol.entry(db, lab, slug, params, robot)


def agree(lab: Lab, slug: str, params: dict[str, str], **changes: Any) -> Enrolled | Refused | Entry:
    with lab.database.writing() as db:
        given = {"agree": True, "device": DESKTOP} | changes
        return enrol.consent(db, lab, slug, params, **given)


def rows(database: Database) -> dict[str, int]:
    with database.reading() as db:
        return {
            name: db.read(select(func.count()).select_from(table)).scalar_one()
            for name, table in metadata.tables.items()
        }


def set_status(lab: Lab, study_id: int, status: str) -> None:
    with lab.database.writing() as db:
        studies.set_status(db, study_id, status)


def small(places: int = 1, **changes: Any) -> Any:
    study = definition("traffic-junction", trials_per_block=1, **changes)
    return study.model_copy(update={"arms": (study.arms[0].model_copy(update={"places": places}),)})


def test_consent_stores_who_what_and_how_the_arm_was_drawn(lab: Lab) -> None:
    study = definition("parent-child")
    launch(lab, study)
    key = come_in(lab, "parent-child", "ada")
    row = person(lab, key)
    assert (row.mode, row.status, row.page, row.device) == ("live", "active", "instructions:1", "desktop")
    assert row.key_sha256 == canonical.sha256(key)
    assert len(key) == 43
    with lab.database.reading() as db:
        who, drawn = enrolments.identity_of(db, row.id), enrolments.allocation_of(db, row.id)
    assert (who.external_id, who.submission_id) == ("ada", "sub-ada")
    assert canonical.loads(who.parameters)["PROLIFIC_PID"] == "ada"
    again = allocation.allocate(
        {arm.name: arm.places for arm in study.arms}, study.role_orders, row.device, {}, drawn.seed
    )
    assert again is not None
    assert (again.arm, again.role_order, again.probability) == (row.arm, row.role_order, drawn.probability)
    assert sorted(canonical.loads(row.number_permutation)) == list(range(1, 10))


def test_the_marketplace_id_stands_in_one_table_only(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    come_in(lab, "parent-child", "unmistakable-name")
    with lab.database.reading() as db:
        holders = {
            name
            for name, table in metadata.tables.items()
            for row in db.read(select(table))
            if any("unmistakable-name" in str(value) for value in row)
        }
    assert holders == {"identity"}


@pytest.mark.parametrize("params", [prolific("ada"), {}, PREVIEW])
def test_looking_at_the_entry_page_stores_nothing(lab: Lab, params: dict[str, str]) -> None:
    launch(lab, definition("parent-child"))
    before = rows(lab.database)
    assert enter(lab, "parent-child", params).kind == ("preview" if params is PREVIEW else "consent")
    assert rows(lab.database) == before


def test_of_a_refusal_stay_a_keyed_hash_a_status_and_a_date(lab: Lab) -> None:
    study_id = launch(lab, definition("parent-child"))
    before = rows(lab.database)
    assert isinstance(agree(lab, "parent-child", prolific("ada"), agree=False), Refused)
    assert rows(lab.database) == {**before, "refusal": 1}
    with lab.database.reading() as db:
        kept = refusals.of(db, study_id, lab.external_hash("prolific", "ada"))
    assert kept is not None
    assert kept[2:] == ("live", "declined", "2026-11-24")


def test_who_declined_is_not_taken_in_by_going_back(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    agree(lab, "parent-child", prolific("ada"), agree=False)
    assert enter(lab, "parent-child", prolific("ada")).kind == "declined"
    again = agree(lab, "parent-child", prolific("ada"))
    assert isinstance(again, Entry)
    assert again.kind == "declined"
    assert rows(lab.database)["participant"] == 0


def test_nothing_stays_of_somebody_whom_nobody_named(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    before = rows(lab.database)
    assert isinstance(agree(lab, "parent-child", {}, agree=False), Refused)
    assert rows(lab.database) == before


def test_a_preview_cannot_consent(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    before = rows(lab.database)
    result = agree(lab, "parent-child", PREVIEW)
    assert isinstance(result, Entry)
    assert result.kind == "preview"
    assert rows(lab.database) == before


def test_who_comes_back_goes_on_where_they_were(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    key = come_in(lab, "parent-child", "ada")
    go_on(lab, key)
    entry = enter(lab, "parent-child", prolific("ada"))
    assert (entry.kind, entry.key) == ("resume", key)
    assert come_in(lab, "parent-child", "ada") == key
    assert person(lab, key).page == "play:1"
    assert come_in(lab, "parent-child", "bob") != key


def test_the_same_name_on_another_marketplace_or_study_is_another_person(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    launch(lab, definition("traffic-junction"))
    worker = {"workerId": "ada", "assignmentId": "a1", "hitId": "h", "turkSubmitTo": "https://www.mturk.com"}
    results = [
        agree(lab, "parent-child", prolific("ada")),
        agree(lab, "parent-child", worker),
        agree(lab, "traffic-junction", prolific("ada")),
    ]
    assert len({result.key for result in results if isinstance(result, Enrolled)}) == 3


def test_one_name_consenting_in_many_tabs_at_once_is_one_person(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    barrier, keys = threading.Barrier(6), []

    def consent() -> None:
        barrier.wait()
        keys.append(come_in(lab, "parent-child", "ada"))

    threads = [threading.Thread(target=consent) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(keys) == 6
    assert len(set(keys)) == 1
    assert rows(lab.database)["participant"] == 1


def test_many_people_at_once_never_exceed_the_places(lab: Lab) -> None:
    launch(lab, small(places=3))
    barrier, results = threading.Barrier(8), []

    def consent(name: str) -> None:
        barrier.wait()
        results.append(agree(lab, "traffic-junction", prolific(name)))

    threads = [threading.Thread(target=consent, args=(f"p{n}",)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert Counter(type(result) for result in results) == {Enrolled: 3, Entry: 5}
    assert {result.kind for result in results if isinstance(result, Entry)} == {"full"}


def test_a_direct_link_is_somebody_new_but_a_form_sent_twice_is_one_person(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    one, two = (dict(enter(lab, "parent-child", {}).identifiers) for _ in range(2))
    keys = [agree(lab, "parent-child", form) for form in (one, one, two)]
    assert keys[0] == keys[1] != keys[2]
    assert agree(lab, "parent-child", {}) != agree(lab, "parent-child", {})
    assert agree(lab, "parent-child", {"visit": "x"}) != agree(lab, "parent-child", {"visit": "x"})


def test_places_are_held_by_who_finished_and_who_was_seen_within_the_lease(
    sqlite_database: Database,
) -> None:
    clock = FakeClock()
    lab = fake_lab(sqlite_database, clock=clock)
    launch(lab, small(lease_min=30))
    first = come_in(lab, "traffic-junction", "ada")
    assert enter(lab, "traffic-junction", prolific("bob")).kind == "full"
    clock.now += timedelta(minutes=31)
    second = come_in(lab, "traffic-junction", "bob")
    play_all(lab, second)
    clock.now += timedelta(days=2)
    assert enter(lab, "traffic-junction", prolific("eve")).kind == "full"
    assert enter(lab, "traffic-junction", prolific("ada")).key == first


@pytest.mark.parametrize("status", ["paused", "closed"])
def test_a_study_that_takes_nobody_says_so_but_lets_people_finish(lab: Lab, status: str) -> None:
    study_id = launch(lab, definition("traffic-junction", trials_per_block=1))
    key = come_in(lab, "traffic-junction", "ada")
    set_status(lab, study_id, status)
    assert enter(lab, "traffic-junction", prolific("bob")).kind == status
    result = agree(lab, "traffic-junction", prolific("bob"))
    assert isinstance(result, Entry)
    assert result.kind == status
    assert enter(lab, "traffic-junction", prolific("ada")).key == key
    play_all(lab, key)
    assert person(lab, key).status == "finished"
    assert enter(lab, "traffic-junction", prolific("ada")).kind == "resume"


def test_a_study_that_was_never_launched_is_not_found(lab: Lab) -> None:
    assert enter(lab, "nothing", {}).kind == "not_found"
    with lab.database.writing() as db:
        studies.add(db, "parent-child", "T", "test", "", lab.now_utc())
    assert enter(lab, "parent-child", {}).kind == "not_found"
    with pytest.raises(NotFoundError):
        agree(lab, "parent-child", {})
    with lab.database.reading() as db, pytest.raises(NotFoundError):
        enrol.participant_by_key(db, lab, "no-such-key")


def test_arms_and_orders_are_balanced_within_device_class(sqlite_database: Database) -> None:
    lab = fake_lab(sqlite_database)
    launch(lab, definition("parent-child"))
    for index in range(64):
        device = DeviceReport("desktop" if index % 2 else "tablet", "B", "1x1")
        agree(lab, "parent-child", prolific(f"p{index}"), device=device)
    with lab.database.reading() as db:
        cells = participants.holding_places(db, 1, "live", {})
    assert sum(cell.people for cell in cells) == 64
    assert len(cells) == 8
    assert max(c.people for c in cells) - min(c.people for c in cells) <= 5


def test_an_unknown_device_is_a_class_of_its_own(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    key = come_in(lab, "parent-child", "ada", DeviceReport("toaster", "x" * 500, "y"))
    row = person(lab, key)
    assert (row.device, len(row.browser)) == ("unknown", 120)


def robot(lab: Lab, slug: str) -> str:
    return TimestampSigner(lab.secret_key, salt="robot").sign(slug).decode()


def test_robots_need_the_servers_signature_and_never_mix_with_people(lab: Lab) -> None:
    launch(lab, small(places=1))
    come_in(lab, "traffic-junction", "ada")
    signature = robot(lab, "traffic-junction")
    assert enter(lab, "traffic-junction", prolific("bob")).kind == "full"
    result = agree(lab, "traffic-junction", prolific("r2"), robot=signature)
    assert isinstance(result, Enrolled)
    assert person(lab, result.key).mode == "robot"
    assert enter(lab, "traffic-junction", prolific("r3"), signature).kind == "full"
    signed, _, seal = signature.rpartition(".")
    forged = f"{signed}.{seal.swapcase()}"  # a last letter alone may differ in bits that are not used
    for wrong in ("", "traffic-junction", robot(lab, "parent-child"), forged):
        with pytest.raises(BadInputError, match="X-Hatlab-Robot"):
            agree(lab, "traffic-junction", prolific("r4"), robot=wrong)


def test_a_test_study_enrols_in_test_mode(lab: Lab) -> None:
    launch(lab, definition("parent-child"), mode="test")
    assert person(lab, come_in(lab, "parent-child")).mode == "test"


def test_keys_cannot_be_guessed_from_ids(lab: Lab) -> None:
    launch(lab, definition("parent-child"))
    row = person(lab, come_in(lab, "parent-child"))
    other = fake_lab(lab.database)
    object.__setattr__(other, "secret_key", "another secret")
    assert lab.participant_key(row.id) != other.participant_key(row.id)
    with lab.database.reading() as db, pytest.raises(NotFoundError):
        enrol.participant_by_key(db, lab, other.participant_key(row.id))
