"""What stops a run leaves the last good checkpoint whole and says so in one line."""

from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from models.cli import app
from models.training import StoppedError, config, run
from models.training.checkpoint import FILE, read
from models.training.log import FILE as LOG
from models.training.trainer import Trainer
from tests.models.training.small import RECIPE

FULL = Path("/dev/full")
"""Linux: every write to it fails as on a full disk."""
needs_full = pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(RECIPE)
    return path


def left_after(recipe: Path, folder: Path, updates: int) -> Trainer:
    trainer = Trainer(config.load(recipe), folder, folder)
    trainer.open(resume=False)
    for _ in range(updates):
        trainer.advance()
    return trainer


def poison(trainer: Trainer) -> None:
    with torch.no_grad():
        trainer.learner.net.head[0].weight.fill_(np.nan)


def test_a_loss_that_is_not_a_number_stops_with_the_last_good_checkpoint(recipe, tmp_path):
    trainer = left_after(recipe, tmp_path / "run", 4)
    poison(trainer)
    with pytest.raises(StoppedError, match=r"loss is nan at update 5 \(phase .quantise.\); last good chec.*"):
        trainer.advance()
    held = read(tmp_path / "run")
    assert held.facts["at"]["total"] == 3
    assert all(torch.isfinite(tensor).all() for tensor in held.tensors.values())
    assert run(recipe, tmp_path / "run", resume=True, progress=False).updates > 4


def test_a_gradient_that_is_not_a_number_touches_no_weight(recipe, tmp_path):
    trainer = left_after(recipe, tmp_path / "run", 3)
    before = {name: value.clone() for name, value in trainer.learner.state_dict().items()}
    trainer.learner.net.encoder.plain.weight.register_hook(lambda gradient: gradient * np.nan)
    with pytest.raises(StoppedError, match="gradient is nan at update 4"):
        trainer.advance()
    assert all(torch.equal(before[name], now) for name, now in trainer.learner.state_dict().items())


def test_without_a_checkpoint_the_line_says_what_to_do(recipe, tmp_path):
    trainer = left_after(recipe, tmp_path / "run", 1)
    poison(trainer)
    with pytest.raises(StoppedError, match="no checkpoint yet; lower the learning rate"):
        trainer.advance()


@needs_full
def test_a_full_disk_at_a_checkpoint_leaves_the_last_one_whole(recipe, tmp_path):
    whole = run(recipe, tmp_path / "whole", progress=False)
    folder = tmp_path / "run"
    left_after(recipe, folder, 3)
    before = (folder / FILE).read_bytes()
    (folder / (FILE + ".new")).symlink_to(FULL)
    with pytest.raises(StoppedError, match=r"cannot be written \(No space left on device\); last good check"):
        run(recipe, folder, resume=True, progress=False)
    assert (folder / FILE).read_bytes() == before
    assert not (folder / (FILE + ".new")).is_symlink()
    assert run(recipe, folder, resume=True, progress=False).score == whole.score
    one, other = read(tmp_path / "whole").tensors, read(folder).tensors
    assert all(torch.equal(one[name], other[name]) for name in one)


@needs_full
def test_a_full_disk_at_the_log_leaves_the_last_checkpoint_whole(recipe, tmp_path):
    folder = tmp_path / "run"
    trainer = left_after(recipe, folder, 3)
    before = (folder / FILE).read_bytes()
    (folder / LOG).unlink()
    (folder / LOG).symlink_to(FULL)
    trainer.advance()
    with pytest.raises(StoppedError, match=r"No space left on device\); last good checkpoint"):
        trainer.advance()
    assert (folder / FILE).read_bytes() == before


def failed(*words: object) -> str:
    done = CliRunner().invoke(app, ["train", *(str(word) for word in words)])
    assert done.exit_code == 1
    assert done.stdout == ""
    lines = [line for line in done.stderr.splitlines() if "cannot be written" in line or " is nan" in line]
    assert len(lines) == 1
    assert "Traceback" not in done.stderr
    return lines[0]


def test_the_command_exits_1_when_the_loss_is_not_a_number(recipe, tmp_path):
    recipe.write_text(RECIPE.replace("updates = 3", "updates = 3\nlr = 1e37"))
    assert "at update 1 (phase 'listen'); no checkpoint yet" in failed(recipe, "--out", tmp_path / "run")


@needs_full
def test_the_command_exits_1_on_a_full_disk(recipe, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / LOG).symlink_to(FULL)
    assert "No space left on device" in failed(recipe, "--out", tmp_path / "run")


def test_the_command_exits_2_for_a_device_that_is_not_there(recipe, tmp_path):
    words = ["train", str(recipe), "--out", str(tmp_path / "run"), "--device", "meta"]
    done = CliRunner().invoke(app, words)
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith("device 'meta' cannot be used here")
    assert not (tmp_path / "run").exists()
