"""A run that is killed goes on as if nothing had happened."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from models.training import TrainingError, run
from models.training.checkpoint import FILE, CheckpointError, read
from models.training.trainer import Trainer
from tests.models.training.small import RECIPE

TRAIN = "import sys; from models.training import run; run(sys.argv[1], sys.argv[2], progress=False)"


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(RECIPE)
    return path


def rows(folder: Path) -> list[list[str]]:
    """The log without the clock."""
    with (folder / "log.csv").open() as file:
        return [[cell for number, cell in enumerate(row) if number != 4] for row in csv.reader(file)]


def kill_when_checked(recipe: Path, folder: Path, checks: int) -> None:
    """Start a run in a process of its own and kill it once it has logged so many checks."""
    process = subprocess.Popen(
        [sys.executable, "-c", TRAIN, str(recipe), str(folder)], env={**os.environ, "OMP_NUM_THREADS": "1"}
    )
    log = folder / "log.csv"
    try:
        while process.poll() is None and (not log.exists() or log.read_text().count("\n") <= checks):
            time.sleep(0.005)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()


def test_a_run_killed_in_the_middle_ends_with_the_same_weights_and_log(recipe, tmp_path):
    whole = run(recipe, tmp_path / "whole", progress=False)
    kill_when_checked(recipe, tmp_path / "killed", checks=3)
    held = read(tmp_path / "killed").facts
    assert 0 < held["at"]["total"] < whole.updates
    resumed = run(recipe, tmp_path / "killed", resume=True, progress=False)
    one, other = read(tmp_path / "whole"), read(tmp_path / "killed")
    assert one.tensors.keys() == other.tensors.keys()
    assert all(torch.equal(one.tensors[name], other.tensors[name]) for name in one.tensors)
    assert rows(tmp_path / "whole") == rows(tmp_path / "killed")
    assert (whole.score, whole.steps, whole.updates) == (resumed.score, resumed.steps, resumed.updates)
    assert {row[0] for row in rows(tmp_path / "whole")[1:]} == {"listen", "quantise", "talk", "enforce"}
    assert not (tmp_path / "killed" / (FILE + ".new")).exists()


def test_a_finished_run_is_only_read(recipe, tmp_path):
    first = run(recipe, tmp_path / "run", progress=False)
    before = (tmp_path / "run" / FILE).read_bytes()
    again = run(recipe, tmp_path / "run", resume=True, progress=False)
    assert (tmp_path / "run" / FILE).read_bytes() == before
    for name, weight in first.policy.weights().items():
        assert torch.equal(weight, again.policy.weights()[name])


def test_a_folder_with_a_run_is_not_overwritten_nor_mixed(recipe, tmp_path):
    run(recipe, tmp_path / "run", progress=False)
    with pytest.raises(TrainingError, match="holds a run already"):
        run(recipe, tmp_path / "run", progress=False)
    recipe.write_text(RECIPE.replace("seed = 3", "seed = 4"))
    with pytest.raises(TrainingError, match="belongs to another recipe"):
        run(recipe, tmp_path / "run", resume=True, progress=False)


def test_a_damaged_checkpoint_is_named(recipe, tmp_path):
    run(recipe, tmp_path / "run", progress=False)
    path = tmp_path / "run" / FILE
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(CheckpointError, match=r"checkpoint\.safetensors: damaged"):
        run(recipe, tmp_path / "run", resume=True, progress=False)


def test_a_missing_start_says_what_to_train_first(recipe, tmp_path):
    recipe.write_text('init_from = "traffic_junction/none"\n' + RECIPE)
    with pytest.raises(TrainingError, match=r"init_from traffic_junction/none: .* train that recipe first"):
        run(recipe, tmp_path / "run", progress=False, bundles=tmp_path)


def test_a_loss_that_is_not_a_number_stops_with_the_last_good_checkpoint(recipe, tmp_path, monkeypatch):
    real = Trainer.advance

    def poisoned(trainer: Trainer) -> None:
        if trainer.at.total == 4:
            with torch.no_grad():
                trainer.learner.net.head[0].weight.fill_(np.nan)
        real(trainer)

    monkeypatch.setattr(Trainer, "advance", poisoned)
    with pytest.raises(
        TrainingError, match=r"loss is nan .* last good checkpoint: .*checkpoint\.safetensors"
    ):
        run(recipe, tmp_path / "run", progress=False)
    held = read(tmp_path / "run")
    assert all(torch.isfinite(tensor).all() for tensor in held.tensors.values())
    monkeypatch.undo()
    assert run(recipe, tmp_path / "run", resume=True, progress=False).updates > 4
