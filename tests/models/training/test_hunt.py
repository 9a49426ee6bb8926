"""Predator-Prey goes through training like any other world."""

import csv
from pathlib import Path

import numpy as np
import pytest

from models.envs import registry
from models.policies.team import Team
from models.rollout import episodes
from models.training import run
from tests.models.training.hunt import RECIPE


@pytest.mark.parametrize("task", ["predator_prey/5x5", "predator_prey/10x10"])
def test_three_updates_of_a_recipe_leave_a_policy_that_hunts(task: str, tmp_path: Path) -> None:
    recipe = tmp_path / "hunt.toml"
    recipe.write_text(RECIPE.replace("predator_prey/5x5", task))

    result = run(recipe, tmp_path / "run", progress=False)

    with (tmp_path / "run" / "log.csv").open() as file:
        logged = list(csv.DictReader(file))
    env = registry.make(task)
    assert result.steps == 3 * 4 * env.steps_max
    assert "imitation=" in logged[0]["parts"]
    assert all("decoder=" in row["parts"] for row in logged)
    assert float(logged[0]["message_rate"]) == 1.0  # the gate is open
    played = episodes(env, Team(env, result.policy), np.arange(3, dtype=np.uint64))
    assert played.alive.all()
    assert played.actions.max() < env.actions
