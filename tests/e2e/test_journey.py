"""The whole journey with a keyboard only, in both window sizes and in both directions; then what was stored.

Pictures of every page are kept in artefacts/e2e/; every page is checked by axe-core (journey.mjs).
"""

import json
import sqlite3
import subprocess
from typing import Any

import pytest

from tests.e2e.laboratory import ROOT, Laboratory

pytestmark = pytest.mark.browser

ARTEFACTS = ROOT / "artefacts" / "e2e"
SCENARIO_S = 500  # a whole journey is thirty pages, each with a picture and a check


def walk(lab: Laboratory, *words: str) -> dict[str, Any]:
    """What the scenario says about itself: the key of the session, and what was answered."""
    scenario, *more = words
    done = subprocess.run(
        ("node", "tests/e2e/journey.mjs", scenario, lab.url, str(ARTEFACTS), *more),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=SCENARIO_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr + (lab.folder / "server.log").read_text()[-2000:]
    told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return told


def rows(lab: Laboratory, query: str, *values: str) -> list[sqlite3.Row]:
    with sqlite3.connect(lab.database) as db:
        db.row_factory = sqlite3.Row
        return db.execute(query, values).fetchall()


def newest(lab: Laboratory) -> sqlite3.Row:
    return rows(lab, "SELECT * FROM participant ORDER BY consented_utc DESC LIMIT 1")[0]


@pytest.mark.parametrize(
    ("slug", "size"),
    [
        ("whole-parent-child", "large"),
        ("whole-parent-child", "small"),
        ("whole-traffic", "small"),
        ("deutsch", "small"),
        ("arabic", "large"),
    ],
)
def test_a_keyboard_leads_through_everything_and_every_answer_is_stored_with_its_time(
    lab: Laboratory, slug: str, size: str
) -> None:
    told = walk(lab, "whole", slug, size)
    person = newest(lab)
    assert (person["status"], person["device"]) == ("finished", "desktop")
    stored = rows(lab, "SELECT * FROM answer WHERE participant_id = ?", person["id"])
    given = {row["item"]: row["value"] for row in stored if row["value"]}
    assert given == {key: value for key, value in told["answers"].items() if value}
    for row in stored:
        if row["value"]:
            assert 0 <= row["first_ms"] <= row["last_ms"]
            assert row["changes"] >= 1
    visits = rows(lab, "SELECT * FROM browser_event WHERE participant_id = ?", person["id"])
    loaded = {row["page"] for row in visits if row["kind"] == "loaded"}
    assert {"instructions:1", "play:1"} <= loaded
    check = lab.hatlab("verify")
    assert check.returncode == 0, check.stdout + check.stderr


def test_a_phone_is_told_kindly_and_only_its_owner_tells_the_site(lab: Laboratory) -> None:
    before = rows(lab, "SELECT count(*) AS people FROM participant")[0]["people"]
    walk(lab, "phone")
    assert rows(lab, "SELECT count(*) AS people FROM participant")[0]["people"] == before
    kept = rows(lab, "SELECT status FROM refusal ORDER BY rowid DESC LIMIT 1")
    assert [row["status"] for row in kept] == ["screened_out"]


def test_a_small_window_can_be_made_larger_and_the_consent_read_meanwhile(lab: Laboratory) -> None:
    assert walk(lab, "small_gate")["key"] == ""


def test_who_wants_little_motion_sees_a_still_example_until_asking_for_it(lab: Laboratory) -> None:
    walk(lab, "still")


def test_two_failed_tries_of_the_quiz_end_kindly_with_a_code(lab: Laboratory) -> None:
    walk(lab, "fail_quiz")
    person = newest(lab)
    assert (person["status"], person["completion_code"]) == ("screened_out", "NOT-THIS-TIME")


def test_help_full_screen_and_the_way_out_are_there_and_every_end_has_its_page(lab: Laboratory) -> None:
    key = walk(lab, "leave")["key"]
    person = newest(lab)
    assert (person["status"], person["completion_code"]) == ("withdrawn", "LEFT-EARLY")
    kinds = rows(lab, "SELECT kind FROM browser_event WHERE participant_id = ?", person["id"])
    assert {"fullscreen", "windowed"} <= {row["kind"] for row in kinds}
    for state in ("finished", "failed", "screened_out", "timed_out", "returned", "rejected"):
        with sqlite3.connect(lab.database) as db:
            # What leads to these ends is tested without a browser; here they are only looked at.
            code = "A-CODE" if state in {"finished", "failed", "screened_out"} else None
            db.execute(
                "UPDATE participant SET status = ?, completion_code = ? WHERE id = ?",
                (state, code, person["id"]),
            )
        walk(lab, "end", key, state)
