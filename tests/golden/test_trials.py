"""Stored trials keep their meaning for ever: these were written on 2026-11-24 and must fold to the same end.

If one no longer does, the world has changed: give it a new version, and say so under "Replay" in the
changelog. The file is never written again; new trials go into a new file.
"""

import json
from pathlib import Path
from typing import Any

import pytest

from server.domain import canonical, events, trial
from server.domain.spec import TrialSpec

GOLDEN = json.loads((Path(__file__).parent / "trials.json").read_text())


@pytest.mark.parametrize("golden", GOLDEN, ids=[g["about"] for g in GOLDEN])
def test_a_golden_trial_folds_to_its_end(golden: dict[str, Any]) -> None:
    bodies = [canonical.loads(body) for body in golden["bodies"]]
    now = trial.start(TrialSpec.model_validate(bodies[0]["spec"]))
    now = trial.spoken(now, events.said_in(bodies[0]))
    for body in bodies[1:]:
        now = trial.apply(now, body)
        assert [body["saw"]["row"], body["saw"]["col"]] == list(divmod(now.cell, now.env.shape[1]))
    ends = {"outcome": now.outcome, "steps": now.step, "progress": now.progress, "cell": now.cell}
    assert ends | {"trail": list(now.trail)} == {n: golden[n] for n in (*ends, "trail")}


@pytest.mark.parametrize("golden", GOLDEN, ids=[g["about"] for g in GOLDEN])
def test_a_golden_trial_keeps_its_digest(golden: dict[str, Any]) -> None:
    digest = ""
    for body in golden["bodies"]:
        assert canonical.dumps(canonical.loads(body)) == body
        digest = events.digest(digest, body)
    assert digest == golden["digest"]


def test_the_golden_trials_hold_every_role_and_most_ends() -> None:
    about = {tuple(g["about"].split(", ")) for g in GOLDEN}
    assert {role for role, _, _ in about} == {"parent", "child", "driver"}
    assert {end for _, _, end in about} >= {"found", "not_found", "arrived", "collision"}
