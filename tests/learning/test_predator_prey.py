"""Slow: does training teach predators to listen? Run by `make learn`."""

from pathlib import Path

import numpy as np
import pytest

from models.envs import registry
from models.policies.team import Team
from models.rollout import episodes
from models.training import run

TOLD = """
name = "predator_prey/told"
task = "predator_prey/5x5"
seed = 1
[model]
hidden = 32
message = 25
[decoder]
target = "location"
reads = "inbox"
[check]
every = 60
episodes = 200
score = "reward"
[[phase]]
name = "imitate"
kind = "imitate"
updates = 60
episodes = 48
window = 5
lr = 5e-3
rule_share = 1.0
decoder_weight = 0.5
"""


@pytest.mark.learn
def test_blind_predators_that_imitate_find_the_prey_by_what_they_hear(tmp_path: Path) -> None:
    (tmp_path / "told.toml").write_text(TOLD)
    result = run(tmp_path / "told.toml", tmp_path / "run", progress=False)
    env, seeds = registry.make("predator_prey/5x5"), np.arange(200, dtype=np.uint64)
    heard = episodes(env, Team(env, result.policy), seeds)
    masked = episodes(env, Team(env, result.policy), seeds, masked=True)

    assert heard.rewards.sum(0).mean() > 1.5
    assert heard.success.mean() > masked.success.mean() + 0.5
