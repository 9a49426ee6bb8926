"""An export of a whole study: answers, marks, window events, journeys, who is analysed and who is not."""

import csv
import json
from collections import Counter
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from server.domain import canonical
from server.domain.participation import Event
from server.domain.study import StudyDefinition
from server.services import codebook, enrol, journey, leave, watch
from server.services.export import export
from server.services.lab import Lab
from server.services.session import session_of
from server.storage import participants
from server.storage.database import Database
from tests.fakes import FakeClock, definition, fake_bundle, fake_lab
from tests.server.services.steps import DESKTOP, come_in, launch, prolific
from tests.server.services.walks import (
    TIMED,
    asked,
    at_end,
    careless,
    entered,
    hand_in,
    on,
    page,
    walk_to,
    wrong,
)

SLUG = "parent-child"
Tables = dict[str, list[dict[str, str]]]


@pytest.fixture
def lab(sqlite_database: Database) -> Lab:
    return fake_lab(sqlite_database)


def exported(lab: Lab, folder: Path, slug: str = SLUG) -> Tables:
    export(lab, slug, (), folder)

    def read_table(name: str) -> list[dict[str, str]]:
        with (folder / f"{name}.csv").open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))

    return {name: read_table(name) for name in codebook.TABLES}


def happen(lab: Lab, key: str, event: Event, source: str = "prolific") -> None:
    with lab.database.writing() as db:
        who = participants.hold(db, enrol.participant_by_key(db, lab, key).id)
        journey.happen(db, lab, session_of(db, lab, who), event, source)


def withdraw(lab: Lab, key: str, *, keep: bool) -> None:
    with lab.database.writing() as db:
        leave.withdraw(db, lab, enrol.participant_by_key(db, lab, key), keep=keep)


def whole(slug: str = SLUG, **changes: object) -> StudyDefinition:
    return definition(slug, whole=True, **{"trials_per_block": 2} | changes)


def test_every_answer_is_one_row_with_its_words_and_its_timing(lab: Lab, tmp_path: Path) -> None:
    key = entered(lab, SLUG)
    walk_to(lab, key, asked("quiz"))
    hand_in(lab, key, wrong(page(lab, key)), timing=TIMED)
    walk_to(lab, key, at_end)
    found = exported(lab, tmp_path / "out")
    rows = found["answers"]
    keys = [(r["participant"], r["form"], r["block"], r["attempt"], r["item"]) for r in rows]
    assert len(set(keys)) == len(keys)
    assert Counter(row["form"] for row in rows) == {
        "quiz": 9,
        "attention": 2,
        "tlx": 12,
        "trust": 6,
        "demographics": 4,
        "comment": 1,
        "probe": 9,
    }
    assert Counter((row["block"], row["attempt"]) for row in rows if row["form"] == "quiz") == {
        ("1", "1"): 3,
        ("1", "2"): 3,
        ("2", "1"): 3,
    }
    assert [row["block"] for row in rows if row["form"] == "attention"] == ["1", "2"]
    assert {row["block"] for row in rows if row["form"] in {"trust", "probe"}} == {"0"}
    first = ("quiz", "1", "1")
    first_try = [row["correct"] for row in rows if (row["form"], row["block"], row["attempt"]) == first]
    assert sorted(first_try) == ["false", "true", "true"]
    [games] = [row for row in rows if row["item"] == "games"]
    assert (games["value"], games["label"], games["correct"]) == ("1", "Never or almost never", "")
    assert (games["first_ms"], games["last_ms"], games["changes"]) == ("812.25", "1604.5", "2")
    assert {row["label"] for row in rows if row["form"] == "tlx"} == {""}
    assert all(row["answered_utc"] for row in rows)


def test_what_somebody_wrote_cannot_run_in_a_spreadsheet_and_a_negative_number_stays_one(
    lab: Lab, tmp_path: Path
) -> None:
    items = [
        {"key": "comment", "text": "Say something", "kind": "text"},
        {"key": "shift", "text": "Better or worse?", "kind": "number", "minimum": -10, "maximum": 10},
    ]
    asked_once = [{"key": "about", "title": "About", "items": items}]
    key = entered(lab, "traffic-junction", questionnaires=asked_once)
    walk_to(lab, key, asked("questionnaire"))
    hand_in(lab, key, {"comment": "=1+1", "shift": "-2.50"})
    rows = {
        row["item"]: row["value"] for row in exported(lab, tmp_path / "out", "traffic-junction")["answers"]
    }
    assert rows["comment"] == "'=1+1"
    assert rows["shift"] == "-2.5"


def test_marks_are_scored_against_what_the_token_means(lab: Lab, tmp_path: Path) -> None:
    key = entered(lab, SLUG)
    walk_to(lab, key, at_end)
    rows = exported(lab, tmp_path / "out")["probe"]
    assert [row["sign"] for row in rows] == [str(number) for number in range(1, 10)]
    assert sorted(row["token"] for row in rows) == [str(token) for token in range(9)]
    with lab.database.reading() as db:
        who = enrol.participant_by_key(db, lab, key)
    bundle = {arm.name: arm.bundle for arm in whole().arms}[who.arm]
    said = np.asarray(lab.agent(bundle).lexicon.probability)
    cells = np.arange(81)
    for row in rows:
        of_token = said[int(row["token"])]
        assert (row["row"], row["column"]) == ("4", "4")
        assert float(row["probability"]) == pytest.approx(of_token[40], abs=1e-6)
        assert float(row["best"]) == pytest.approx(of_token.max(), abs=1e-6)
        away = abs(cells // 9 - 4) + abs(cells % 9 - 4)
        assert float(row["distance"]) == pytest.approx((of_token * away).sum(), abs=1e-5)
        assert float(row["least"]) <= float(row["distance"]) + 1e-6
        assert canonical.loads(who.number_permutation)[int(row["position"])] == int(row["sign"])


def test_without_the_agent_marks_are_exported_unscored_and_the_manifest_names_it(
    lab: Lab, tmp_path: Path
) -> None:
    walk_to(lab, entered(lab, SLUG), at_end)
    bare = Lab(lab.settings, lab.database, {}, (), lab.secret_key, now=lab.now)
    rows = exported(bare, tmp_path / "out")["probe"]
    assert len(rows) == 9
    assert {row["probability"] for row in rows} == {""}
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["agents_not_loaded"] == ["parent_child/onehot-9", "parent_child/prototype-9"]


def test_marks_are_not_scored_against_another_agent_of_the_same_name(lab: Lab, tmp_path: Path) -> None:
    walk_to(lab, entered(lab, SLUG), at_end)
    others = {name: fake_bundle(name, seed=2) for name in lab.bundles}
    rows = exported(replace(lab, bundles=others), tmp_path / "out")["probe"]
    assert len(rows) == 9
    assert {row["probability"] for row in rows} == {""}


def test_window_events_and_the_journey_come_in_order(lab: Lab, tmp_path: Path) -> None:
    key = entered(lab, "traffic-junction")
    with lab.database.writing() as db:
        who = enrol.participant_by_key(db, lab, key)
        told = [(0, "loaded", "1280x720", 3.25), (1, "blur", "", 900.5), (2, "focus", "", 2_000.0)]
        watch.keep(db, lab, who, "visit-0001", "instructions:1", told)
    walk_to(lab, key, at_end)
    found = exported(lab, tmp_path / "out", "traffic-junction")
    events = found["browser_events"]
    assert [(row["seq"], row["kind"], row["value"]) for row in events] == [
        ("0", "loaded", "1280x720"),
        ("1", "blur", ""),
        ("2", "focus", ""),
    ]
    assert [row["at_ms"] for row in events] == ["3.25", "900.5", "2000.0"]
    steps = [(row["seq"], row["event"], row["state"], row["source"]) for row in found["journey"]]
    assert steps == [
        ("1", "agree", "consented", "participant"),
        ("2", "read", "instructed", "participant"),
        ("3", "practice_over", "practised", "participant"),
        ("4", "quiz_passed", "quizzed", "participant"),
        ("5", "rounds_over", "surveyed", "participant"),
        ("6", "all_answered", "finished", "participant"),
    ]


def everybody(lab: Lab) -> dict[str, str]:
    """Somebody at every end, each by the name that they came in with; their keys."""
    launch(lab, whole())
    keys = {
        name: come_in(lab, SLUG, name) for name in ("quiz", "gone", "kept", "told", "late", "closed", "now")
    }
    walk_to(lab, keys["quiz"], asked("quiz"))
    for _ in range(2):
        hand_in(lab, keys["quiz"], wrong(page(lab, keys["quiz"])))
    walk_to(lab, keys["gone"], on("play"))
    withdraw(lab, keys["gone"], keep=False)
    walk_to(lab, keys["kept"], asked("quiz"))
    withdraw(lab, keys["kept"], keep=True)
    happen(lab, keys["told"], Event.RETURN_TOLD)
    happen(lab, keys["late"], Event.TIME_OUT_TOLD)
    happen(lab, keys["closed"], Event.REJECTION_TOLD)
    keys |= {name: come_in(lab, SLUG, name) for name in ("fine", "careless")}
    walk_to(lab, keys["fine"], at_end)
    walk_to(lab, keys["careless"], at_end, careless)
    with lab.database.writing() as db:
        enrol.consent(db, lab, SLUG, prolific("no"), agree=False, device=DESKTOP)
        enrol.screen_out(db, lab, SLUG, prolific("phone"))
    return keys


def test_everybody_who_is_not_analysed_has_exactly_one_reason(lab: Lab, tmp_path: Path) -> None:
    keys = everybody(lab)
    ids = {}
    for name, key in keys.items():
        with lab.database.reading() as db:
            ids[enrol.participant_by_key(db, lab, key).id] = name
    found = exported(lab, tmp_path / "out")
    people = {ids[row["participant"]]: row for row in found["participants"]}
    assert {name: (row["status"], row["exclusion_reason"]) for name, row in people.items()} == {
        "quiz": ("screened_out", "quiz"),
        "gone": ("withdrawn", "withdrawn"),
        "kept": ("withdrawn", "withdrawn"),
        "told": ("returned", "returned"),
        "late": ("timed_out", "timed_out"),
        "closed": ("rejected", "rejected"),
        "now": ("active", "incomplete"),
        "fine": ("finished", ""),
        "careless": ("failed", "attention"),
    }
    for row in people.values():
        assert (row["excluded"] == "true") == bool(row["exclusion_reason"])
    assert [people[name]["attention_failed"] for name in ("fine", "careless", "gone")] == ["0", "2", ""]
    won = int(people["fine"]["won"])
    assert won == sum(
        row["success"] == "true" for row in found["trials"] if ids[row["participant"]] == "fine"
    )
    money = {n: (row["reward_minor"], row["bonus_minor"], row["currency"]) for n, row in people.items()}
    assert money["fine"] == ("400", str(3 * won), "GBP")
    assert money["careless"][0] == "400"
    assert money["kept"] == money["gone"] == ("100", "0", "GBP")
    assert money["quiz"] == ("30", "0", "GBP")
    assert money["told"] == money["late"] == money["closed"] == money["now"] == ("0", "0", "GBP")


def test_whoever_was_erased_has_a_row_among_the_participants_and_nowhere_else(
    lab: Lab, tmp_path: Path
) -> None:
    keys = everybody(lab)
    with lab.database.reading() as db:
        gone = enrol.participant_by_key(db, lab, keys["gone"]).id
    found = exported(lab, tmp_path / "out")
    [row] = [row for row in found["participants"] if row["participant"] == gone]
    assert (row["erased"], row["browser"], row["won"]) == ("true", "", "")
    assert [row["erased"] for row in found["participants"]].count("true") == 1
    for table in ("trials", "steps", "answers", "probe", "browser_events", "journey"):
        assert gone not in {row["participant"] for row in found[table]}, table


def test_the_flow_adds_up_from_consent_to_analysis_and_is_the_same_in_the_manifest(
    lab: Lab, tmp_path: Path
) -> None:
    everybody(lab)
    found = exported(lab, tmp_path / "out")
    rows = found["flow"]
    assert {row["mode"] for row in rows} == {"live"}
    whole_study = {row["stage"]: row["people"] for row in rows if not row["arm"]}
    assert whole_study == {
        "invited": "",
        "declined": "1",
        "screened_out": "1",
        "consented": "9",
        "quiz_failed": "1",
        "withdrawn": "2",
        "timed_out": "1",
        "returned": "1",
        "rejected": "1",
        "abandoned": "0",
        "in_progress": "1",
        "erased": "0",
        "finished": "2",
        "attention_failed": "1",
        "analysed": "1",
    }
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["flow"]["live"] == {
        stage: int(people) if people else None for stage, people in whole_study.items()
    }
    for stage in list(whole_study)[3:]:
        of_arms = [int(row["people"]) for row in rows if row["arm"] and row["stage"] == stage]
        assert len(of_arms) == 2
        assert sum(of_arms) == int(whole_study[stage])
    analysed = [row for row in found["participants"] if row["excluded"] == "false"]
    assert len(analysed) == int(whole_study["analysed"])
    assert len(found["participants"]) == int(whole_study["consented"])


def test_whoever_is_not_seen_for_longer_than_the_lease_counts_as_abandoned_in_every_table(
    sqlite_database: Database, tmp_path: Path
) -> None:
    clock = FakeClock()
    lab = fake_lab(sqlite_database, clock=clock)
    entered(lab, SLUG, lease_min=30)
    clock.now += timedelta(minutes=31)
    found = exported(lab, tmp_path / "out")
    [row] = found["participants"]
    assert (row["status"], row["exclusion_reason"]) == ("abandoned", "incomplete")
    flow = {row["stage"]: row["people"] for row in found["flow"] if not row["arm"]}
    assert (flow["abandoned"], flow["in_progress"]) == ("1", "0")


def test_every_value_is_of_the_type_that_the_codebook_names(lab: Lab, tmp_path: Path) -> None:
    key = entered(lab, SLUG)
    with lab.database.writing() as db:
        who = enrol.participant_by_key(db, lab, key)
        watch.keep(db, lab, who, "visit-0001", "instructions:1", [(0, "loaded", "1280x720", 3.25)])
    walk_to(lab, key, at_end)
    found = exported(lab, tmp_path / "out")
    readers = {
        "integer": int,
        "number": float,
        "string": str,
        "boolean": {"true": True, "false": False}.__getitem__,
        "utc": canonical.utc_moment,
    }
    for table, columns in codebook.TABLES.items():
        assert found[table], table
        for column in columns:
            for row in found[table]:
                if row[column.name] != "":
                    readers[column.type](row[column.name])
