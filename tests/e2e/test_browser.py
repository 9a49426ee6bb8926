"""One participant through each task in real Chromium, with real keys; then the database says what arrived.

Pictures of every page are kept in artefacts/e2e/. What happens on the way (reload in the middle of a round,
second tab, lost network, an answer that never arrives) is in play.mjs.
"""

import json
import sqlite3
import subprocess
from collections import Counter
from typing import Any

import pytest

from tests.e2e.laboratory import ROOT, Laboratory

pytestmark = pytest.mark.browser

ARTEFACTS = ROOT / "artefacts" / "e2e"
SCENARIO_S = 240
SESSIONS = ("parent_child", "traffic", "lost_answer", "small_window")


def play(lab: Laboratory, scenario: str) -> list[dict[str, Any]]:
    """The decisions that the browser sent, each (round, seq) once."""
    done = subprocess.run(
        ("node", "tests/e2e/play.mjs", scenario, lab.url, str(ARTEFACTS)),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=SCENARIO_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr + (lab.folder / "server.log").read_text()[-2000:]
    sent: list[dict[str, Any]] = json.loads(done.stdout.splitlines()[-1])["sent"]
    return sent


def stored(lab: Laboratory) -> list[dict[str, Any]]:
    """Decisions in the database, newest participant's only, with round and seq."""
    with sqlite3.connect(lab.database) as db:
        rows = db.execute(
            "SELECT trial.round, event.seq, event.body FROM event JOIN trial ON trial.id = event.trial_id"
            " WHERE event.seq > 0 AND trial.participant_id ="
            " (SELECT id FROM participant ORDER BY consented_utc DESC LIMIT 1) ORDER BY 1, 2"
        ).fetchall()
    return [{"round": round_, "seq": seq, **json.loads(body)} for round_, seq, body in rows]


def person(lab: Laboratory) -> sqlite3.Row:
    with sqlite3.connect(lab.database) as db:
        db.row_factory = sqlite3.Row
        row: sqlite3.Row = db.execute(
            "SELECT * FROM participant ORDER BY consented_utc DESC LIMIT 1"
        ).fetchone()
    return row


@pytest.mark.parametrize("scenario", SESSIONS)
def test_a_participant_plays_and_every_decision_is_stored_once(lab: Laboratory, scenario: str) -> None:
    sent = {(step["round"], step["seq"]): step for step in play(lab, scenario)}
    kept = {(step["round"], step["seq"]): step for step in stored(lab)}
    assert kept.keys() == sent.keys(), "no step is lost, none is doubled"
    for key, step in kept.items():
        assert step["action"] == sent[key]["action"]
        assert step["timing"] == sent[key]["timing"]
    check = lab.hatlab("verify")
    assert check.returncode == 0, check.stdout + check.stderr
    here = person(lab)
    assert (here["device"], here["browser"].split()[0]) == ("desktop", "Chrome")
    if scenario in {"parent_child", "traffic"}:
        assert here["status"] == "finished"
        assert here["completion_code"]
    judge(scenario, list(kept.values()))


def judge(scenario: str, steps: list[dict[str, Any]]) -> None:
    """The flags that the way through the scenario must have left, and no others."""
    timings = [step["timing"] for step in steps]
    resumed = sum(timing["resumed"] for timing in timings)
    hidden = sum(timing["hidden"] for timing in timings)
    board = Counter(timing["board_px"] for timing in timings)
    assert all(timing["is_trusted"] and timing["rt_ms"] >= 0 for timing in timings)
    if scenario == "parent_child":
        assert set(board) == {560}
        assert resumed <= 1, "only the step after the reload"
        assert Counter(timing["input"] for timing in timings)["click"] == 1
    if scenario == "traffic":
        assert set(board) == {490}
        assert resumed == 3, "after the lost connection, in the second tab, and back in the first"
        assert hidden <= 2, "a tab behind another one may be hidden"
    if scenario == "lost_answer":
        assert resumed == 2, "after the lost answers and after the reload"
    if scenario == "small_window":
        assert hidden == 2, "the steps after the board was covered and after the page was hidden"
        assert resumed == 1, "the step after the view was adopted"


def test_the_plugins_work_without_a_server(lab: Laboratory) -> None:
    assert play(lab, "example") == []


def test_declining_previewing_and_unknown_links_have_pages_and_leave_nothing(lab: Laboratory) -> None:
    with sqlite3.connect(lab.database) as db:
        before = db.execute("SELECT count(*) FROM participant").fetchone()
        play(lab, "decline")
        assert db.execute("SELECT count(*) FROM participant").fetchone() == before


def test_the_first_page_is_light(lab: Laboratory) -> None:
    weight = subprocess.run(
        ("node", "tests/e2e/weight.mjs", f"{lab.url}/s/short-parent-child"),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert weight.returncode == 0, weight.stderr
    assert int(weight.stdout) <= 400_000
