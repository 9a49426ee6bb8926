"""How to play, in real Chromium: the example, full screen, and what the pages tell about their window.

By keyboard only; pictures are kept in artefacts/e2e/. What happens is in instructions.mjs.
"""

import hashlib
import re
import secrets
import sqlite3
import subprocess
from typing import Any

import httpx
import pytest

from tests.e2e.laboratory import ROOT, Laboratory

pytestmark = pytest.mark.browser

ARTEFACTS = ROOT / "artefacts" / "e2e"
SCENARIO_S = 180
STUDIES = {"parent": "short-parent-child", "child": "short-parent-child", "driver": "short-traffic"}
INVITED_MAX = 30


def come_in(lab: Laboratory, role: str) -> str:
    """The address of somebody new whose first role is this one: whoever is given another is left alone."""
    for _ in range(INVITED_MAX):
        slug = STUDIES[role]
        person = {
            "PROLIFIC_PID": secrets.token_hex(12),
            "STUDY_ID": "s1",
            "SESSION_ID": secrets.token_hex(12),
        }
        with httpx.Client(base_url=lab.url) as client:
            entry = client.get(f"/s/{slug}", params=person).text
            fields = dict(re.findall(r'<input type="hidden" name="([^"]*)" value="([^"]*)">', entry))
            fields |= {"device": "desktop", "read": "yes", "agree": "yes"}
            address = client.post(f"/s/{slug}/consent", data=fields).headers["location"]
            if f'data-role="{role}"' in client.get(address).text:
                return lab.url + address
    raise AssertionError(f"nobody was the {role}")


def browse(scenario: str, session: str) -> None:
    done = subprocess.run(
        ("node", "tests/e2e/instructions.mjs", scenario, session, str(ARTEFACTS)),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=SCENARIO_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def told(lab: Laboratory, session: str) -> list[list[dict[str, Any]]]:
    """What is stored of each visit, in the order in which the visits' first events came."""
    key_sha256 = hashlib.sha256(session.rsplit("/", 1)[-1].encode()).hexdigest()
    with sqlite3.connect(lab.database) as db:
        db.row_factory = sqlite3.Row
        rows = db.execute(
            "SELECT browser_event.* FROM browser_event JOIN participant ON participant.id = participant_id"
            " WHERE key_sha256 = ? ORDER BY seq",
            (key_sha256,),
        ).fetchall()
    visits: dict[str, list[dict[str, Any]]] = {}
    for row in sorted(map(dict, rows), key=lambda row: (row["stored_utc"], row["seq"])):
        visits.setdefault(row["visit"], []).append(row)
    return [sorted(visit, key=lambda row: int(row["seq"])) for visit in visits.values()]


def kinds(visit: list[dict[str, Any]]) -> list[str]:
    """Without focus, which in a browser without a screen comes and goes as it likes."""
    return [row["kind"] for row in visit if row["kind"] not in {"focus", "blur"}]


@pytest.mark.parametrize("role", STUDIES)
@pytest.mark.parametrize("size", ["large", "small"])
def test_the_example_plays_and_stops_by_keyboard_and_everything_fits(
    lab: Laboratory, size: str, role: str
) -> None:
    browse(size, come_in(lab, role))


def test_who_wants_little_motion_gets_a_still_picture(lab: Laboratory) -> None:
    browse("still", come_in(lab, "parent"))


def test_what_happens_to_the_window_is_stored_once_and_never_stops_the_game(lab: Laboratory) -> None:
    session = come_in(lab, "driver")
    browse("watched", session)
    visits = told(lab, session)
    assert [visit[0]["page"] for visit in visits] == ["instructions:1", "play:1", "play:1"]
    for visit in visits:
        assert [row["seq"] for row in visit] == list(range(len(visit))), "nothing is lost, nothing doubled"
        times = [row["at_ms"] for row in visit]
        assert times == sorted(times)
    read, played, again = visits
    assert kinds(read)[:2] == ["loaded", "fullscreen"]
    assert kinds(played) == ["loaded", "fullscreen", "windowed", "resize", "hidden", "visible"]
    assert kinds(again)[0] == "loaded"
    assert read[0]["value"] == "1280x720"
    assert [row["value"] for row in played if row["kind"] == "resize"] == ["1100x700"]
    assert again[0]["value"] == "1100x700"
