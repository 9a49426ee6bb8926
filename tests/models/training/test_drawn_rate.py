"""What gates send while they are drawn: the greedy rate, which a threshold holds at the budget, hides it."""

from pathlib import Path

import pytest
from rich.console import Console

from models.training import config, curve, log, run
from models.training.run import _status
from models.training.trainer import Trainer

BUDGET = 0.2
RECIPE = """
name = "traffic_junction/gated"
task = "traffic_junction/easy"
seed = 5
[model]
hidden = 8
message = 4
gate = "learned"
[check]
every = 12
episodes = 60
[[phase]]
name = "hold"
updates = 12
episodes = 16
lr = 1e-2
budget = 0.2
"""
DEAD = RECIPE + 'gate = "enforced"\ngate_weight = 0.0\n'
ALIVE = RECIPE + 'gate = "budget"\ngate_weight = 5.0\n'


def written(folder: Path, text: str) -> Path:
    path = folder / "recipe.toml"
    path.write_text(text)
    return path


def last(folder: Path, text: str) -> log.Row:
    return log.read(run(written(folder, text), folder / "run", progress=False).folder)[-1]


def test_an_enforcer_without_a_penalty_shows_in_the_drawn_rate_and_not_in_the_greedy_one(
    tmp_path: Path,
) -> None:
    row = last(tmp_path, DEAD)
    assert BUDGET - 0.05 < float(row["message_rate"]) <= BUDGET
    assert float(row["drawn_rate"]) > BUDGET + 0.2


def test_gates_that_are_taught_the_budget_send_it_when_they_are_drawn_too(tmp_path: Path) -> None:
    assert float(last(tmp_path, ALIVE)["drawn_rate"]) == pytest.approx(BUDGET, abs=0.06)


def test_the_curve_draws_it_and_does_without_it_in_logs_that_lack_it(tmp_path: Path) -> None:
    recipe = config.load(written(tmp_path, DEAD))
    row = last(tmp_path, DEAD)
    lines = {p["line"]: p["value"] for p in curve.chart([row], recipe)["datasets"]["rate"]}
    assert lines["drawn in training"] == float(row.pop("drawn_rate"))
    assert "drawn in training" not in str(curve.chart([row], recipe)["datasets"]["rate"])


def test_progress_shows_it_beside_the_greedy_rate_in_80_columns(tmp_path: Path) -> None:
    trainer = Trainer(config.load(written(tmp_path, DEAD)), tmp_path / "run", tmp_path)
    trainer.open(resume=False)
    assert "success –  rate –  drawn –" in _status(trainer)
    trainer.advance()
    shown = _status(trainer)
    assert f"drawn {trainer.readings.drawn_rate:.3f}" in shown
    assert (
        max(Console().measure(line).maximum for line in shown.splitlines())
        < 80 - len(" 999/999 0:00:00") - 10
    )
