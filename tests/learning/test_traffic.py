"""Slow: does training teach? Run by `make learn`."""

import csv
from pathlib import Path

import pytest

from models.training import run

EASY = """
name = "traffic_junction/easy-test"
task = "traffic_junction/easy"
seed = 1

[model]
hidden = 48
message = 16
tokens = 24
channel = "prototype"

[start]
arrival = [0.1, 0.3]

[decoder]
target = "occupancy"
reads = "inbox"

[check]
every = 20
episodes = 500

[[phase]]
name = "listen"
kind = "imitate"
updates = 100
episodes = 48
window = 5
lr = 2e-3
discrete = false
rule_share = 0.5
brake_weight = 2.0
decoder_weight = 0.1

[[phase]]
name = "quantise"
kind = "imitate"
updates = 60
episodes = 48
window = 5
brake_weight = 2.0
decoder_weight = 0.1

[[phase]]
name = "fine-tune"
updates = 20
episodes = 100
lr = 1e-4
entropy = 0.001
value_weight = 0.05
first_collision_only = true
"""


@pytest.mark.learn
def test_drivers_learn_to_listen_on_the_easy_crossing(tmp_path: Path):
    """Always gas succeeds in .845 of episodes there."""
    (tmp_path / "easy.toml").write_text(EASY)
    result = run(tmp_path / "easy.toml", tmp_path / "run", progress=False)
    with (tmp_path / "run" / "log.csv").open() as file:
        kept = [row for row in csv.DictReader(file) if row["best"] == "1"][-1]
    assert float(kept["success"]) >= 0.95
    assert result.score >= 0.95
