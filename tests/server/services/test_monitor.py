"""Counts of people, on both databases, against people who were put in one by one."""

from collections import Counter
from datetime import timedelta
from itertools import product

import pytest

from server.domain import canonical
from server.domain.flow import Stage
from server.domain.participation import ENDS
from server.domain.plan import plan
from server.services import flow, lease, monitor, studies
from server.services.lab import Lab
from server.services.monitor import MODES, ago, where
from server.storage import participants
from server.storage.participants import ParticipantRow
from tests.fakes import definition
from tests.server.services.steps import come_in, go_on, launch, open_round

SLUG = "parent-child"


@pytest.fixture
def study_id(lab: Lab) -> int:
    return launch(lab, definition(SLUG, lease_min=60), mode="live")


def put(lab: Lab, study_id: int, number: int, **changes: str) -> dict[str, str]:
    """A person of the study; what the monitor counts them by."""
    facts = {"mode": "live", "arm": "prototype", "role_order": "parent-child", "device": "desktop"}
    facts |= {"status": "active", "last_seen_utc": lab.now_utc()} | changes
    with lab.database.writing() as db:
        version = studies.find(db, SLUG).version
        assert version is not None
        blank = dict.fromkeys(ParticipantRow._fields, "")
        row = blank | facts | {"id": f"P{number:010d}", "study_id": study_id, "study_version_id": version.id}
        row |= {
            "key_sha256": f"{number:064d}",
            "page": "play:1",
            "finished_utc": None,
            "completion_code": None,
        }
        participants.add(db, ParticipantRow(**row))  # type: ignore[arg-type]
    return facts


def counted(lab: Lab) -> monitor.Progress:
    with lab.database.reading() as db:
        return monitor.counts(db, lab, studies.find(db, SLUG))


def test_every_count_is_the_number_of_people_of_that_kind(lab: Lab, study_id: int) -> None:
    long_ago = canonical.minutes_before(lab.now(), 90)
    kinds = list(
        product(
            MODES,
            ("prototype", "one-hot"),
            ("parent-child", "child-parent"),
            (
                ("active", None),
                ("active", long_ago),
                ("finished", long_ago),
                ("withdrawn", None),
                ("timed_out", None),
                ("returned", long_ago),
                ("rejected", None),
                ("failed", long_ago),
                ("screened_out", None),
            ),
        )
    )
    people = []
    for number, (mode, arm, order, (status, seen)) in enumerate(kinds * 2):
        facts = {
            "mode": mode,
            "arm": arm,
            "role_order": order,
            "status": status,
            "device": "phone" if number % 3 else "desktop",
        }
        people.append(put(lab, study_id, number, **facts, **({"last_seen_utc": seen} if seen else {})))
    progress = counted(lab)
    for mode in MODES:
        assert progress.modes[mode].people.allocated == len(people) / len(MODES)
        for arm in progress.arms[mode]:
            mine = [p for p in people if p["mode"] == mode and p["arm"] == arm.arm]
            finished = sum(p["status"] == "finished" for p in mine)
            active = sum(p["status"] == "active" and p["last_seen_utc"] > long_ago for p in mine)
            assert (arm.people.finished, arm.people.active) == (finished, active)
            excluded = sum(p["status"] in {"failed", "screened_out"} for p in mine)
            assert arm.people.excluded == excluded
            assert arm.people.left == len(mine) - finished - active - excluded
            assert dict(arm.orders) == Counter(p["role_order"] for p in mine)
            assert dict(arm.devices) == Counter(p["device"] for p in mine)
            assert arm.free == arm.places - finished - active


def test_robots_take_no_place_of_people_and_never_stand_among_them(lab: Lab, study_id: int) -> None:
    for number in range(5):
        put(lab, study_id, number, mode="robot", status="finished")
    progress = counted(lab)
    assert progress.modes["live"].people.allocated == 0
    assert progress.modes["robot"].people.finished == 5
    assert all(arm.free == arm.places for arm in progress.arms["live"])
    with lab.database.reading() as db:
        study = studies.find(db, SLUG)
        assert monitor.people(db, lab, study, "live", "finished") == ()
        assert len(monitor.people(db, lab, study, "robot", "finished")) == 5


def test_people_of_an_earlier_version_are_shown_apart_but_still_hold_their_places(
    lab: Lab, study_id: int
) -> None:
    put(lab, study_id, 1, status="finished")
    with lab.database.writing() as db:
        studies.save_draft(db, lab, SLUG, {**studies.find(db, SLUG).values, "title": "Second"})
    with lab.database.writing() as db:
        studies.launch(db, lab, SLUG, studies.find(db, SLUG).base)
    put(lab, study_id, 2)
    arms = counted(lab).arms["live"]
    assert [(arm.version, arm.arm, arm.people.allocated) for arm in arms] == [
        (2, "prototype", 1),
        (2, "one-hot", 0),
        (1, "prototype", 1),
    ]
    assert arms[0].free == arms[0].places - 2


def test_everybody_keeps_the_lease_of_the_version_that_they_entered(lab: Lab, study_id: int) -> None:
    away_for_long = {"last_seen_utc": canonical.minutes_before(lab.now(), 45)}
    put(lab, study_id, 1, **away_for_long)
    with lab.database.writing() as db:
        shorter = {**studies.find(db, SLUG).values, "lease_min": 30}
        studies.save_draft(db, lab, SLUG, shorter)
    with lab.database.writing() as db:
        studies.launch(db, lab, SLUG, studies.find(db, SLUG).base)
    put(lab, study_id, 2, **away_for_long)
    arms = {arm.version: arm.people for arm in counted(lab).arms["live"] if arm.arm == "prototype"}
    assert (arms[1].active, arms[1].left) == (1, 0)
    assert (arms[2].active, arms[2].left) == (0, 1)
    with lab.database.reading() as db:
        leases = lease.began(db, lab, study_id)
        assert sum(cell.people for cell in participants.holding_places(db, study_id, "live", leases)) == 1
        [live] = flow.flows(db, study_id, lab.now(), ["live"])
    assert (live.whole[Stage.IN_PROGRESS], live.whole[Stage.ABANDONED]) == (1, 1)


def test_a_person_is_listed_where_they_are_with_the_rounds_they_ended(lab: Lab, study_id: int) -> None:
    key = come_in(lab, SLUG, "ada")
    with lab.database.reading() as db:
        [line] = monitor.people(db, lab, studies.find(db, SLUG), "live", "now")
    assert (line.where, line.rounds_done, line.rounds) == ("How to play, block 1", 0, 8)
    assert line.device == "desktop, Firefox 140"
    go_on(lab, key)
    open_round(lab, key)
    with lab.database.reading() as db:
        [line] = monitor.people(db, lab, studies.find(db, SLUG), "live", "now")
    assert (line.where, line.rounds_done) == ("Rounds, block 1", 0)


def test_at_most_fifty_people_are_listed_the_last_seen_first(lab: Lab, study_id: int) -> None:
    for number in range(53):
        seen = canonical.utc_text(lab.now() - timedelta(seconds=number))
        put(lab, study_id, number, last_seen_utc=seen)
    with lab.database.reading() as db:
        lines = monitor.people(db, lab, studies.find(db, SLUG), "live", "now")
    assert [line.id for line in lines] == [f"P{number:010d}" for number in range(50)]


def test_a_study_without_people_counts_nobody(lab: Lab, study_id: int) -> None:
    progress = counted(lab)
    assert progress.modes["live"].places == 76
    assert progress.modes["live"].last_seen_utc == ""
    assert [arm.people.allocated for arm in progress.arms["live"]] == [0, 0]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0 s ago"),
        (59, "59 s ago"),
        (60, "1 min ago"),
        (7_199, "1 h ago"),
        (86_400, "1 day ago"),
        (200_000, "2 days ago"),
    ],
)
def test_times_are_told_in_one_unit(seconds: int, text: str) -> None:
    now = canonical.utc_moment("2026-11-24T12:00:00.000Z")
    assert ago(canonical.utc_text(now - timedelta(seconds=seconds)), now) == text
    assert ago("", now) == ""


def test_pages_have_names_that_people_know() -> None:
    words = {
        "instructions:1": "How to play, block 1",
        "practice:1": "Practice, block 1",
        "quiz:1": "Quiz, block 1",
        "play:2": "Rounds, block 2",
        "survey:2": "Questionnaire, block 2",
        "probe:0": "What the signs mean",
        "survey:0": "Questionnaire",
        "complete": "Completion page",
    }
    assert {page: where(page) for page in words} == words


def test_every_page_of_a_whole_study_has_a_name() -> None:
    for slug in ("parent-child", "traffic-junction"):
        study = definition(slug, whole=True)
        for page in plan(study, study.role_orders[0], 1).pages:
            assert where(page)


def test_every_end_is_counted_and_listed_under_exactly_one_heading() -> None:
    listed = [standing for standings in monitor.SHOWS.values() for standing in standings]
    assert sorted(listed) == sorted({"active", "away", *ENDS} - {"declined"})


@pytest.mark.parametrize(("show", "status"), [("left", "returned"), ("excluded", "failed")])
def test_whoever_came_to_an_end_is_listed_there(lab: Lab, study_id: int, show: str, status: str) -> None:
    put(lab, study_id, 1, status=status)
    put(lab, study_id, 2)
    with lab.database.reading() as db:
        [line] = monitor.people(db, lab, studies.find(db, SLUG), "live", show)
    assert (line.id, line.standing) == ("P0000000001", status)
