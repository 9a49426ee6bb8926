"""A run that is killed goes on as if nothing had happened."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch

from models.training import TrainingError, config, log, run
from models.training.checkpoint import FILE, CheckpointError, read, write
from models.training.trainer import Trainer
from tests.models.training.small import RECIPE

TRAIN = """
import sys
from models.training import run
run(sys.argv[1], sys.argv[2], progress=False, checkpoint_every=int(sys.argv[3]) or None)
"""


TAKE_TURNS = """
import itertools, os, sys
for name in itertools.cycle(sys.argv[1:]):
    os.link(name, "next")
    os.replace("next", "checkpoint.safetensors")
"""


ONE_PHASE = """
[[phase]]
name = "talk"
updates = 40
episodes = 4
gate = "budget"
budget = 0.5
revive_every = 2
entropy = 0.1
entropy_end = 0.01
"""


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(RECIPE)
    return path


def rows(folder: Path) -> list[dict[str, str]]:
    """The log without the clock."""
    return [{key: row[key] for key in row if key not in {"seconds", "cpu_s"}} for row in log.read(folder)]


def updates_saved(folder: Path) -> int:
    """Updates in the checkpoint; 0 before the first."""
    return read(folder).facts["at"]["total"] if (folder / FILE).exists() else 0


def kill_after(recipe: Path, folder: Path, updates: int, checkpoint_every: int = 0) -> None:
    """Start a run in a process of its own and kill -9 it once its checkpoint holds so many updates."""
    process = subprocess.Popen(
        [sys.executable, "-c", TRAIN, str(recipe), str(folder), str(checkpoint_every)],
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    try:
        while process.poll() is None and updates_saved(folder) < updates:
            time.sleep(0.005)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()


def assert_same_end(one: Path, other: Path) -> None:
    """Weights, optimiser, best, place and log of two finished runs are equal, bit for bit."""
    left, right = read(one), read(other)
    assert left.tensors.keys() == right.tensors.keys()
    assert all(torch.equal(left.tensors[name], right.tensors[name]) for name in left.tensors)
    assert left.facts["at"] == right.facts["at"]
    assert rows(one) == rows(other)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run that nobody killed."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "small.toml").write_text(RECIPE)
    return run(folder / "small.toml", folder / "run", progress=False)


@pytest.fixture
def finished(whole, tmp_path):
    """A copy of its folder."""
    return shutil.copytree(whole.folder, tmp_path / "run")


def test_a_run_killed_in_the_middle_ends_with_the_same_weights_and_log(recipe, tmp_path, whole):
    kill_after(recipe, tmp_path / "killed", updates=5)
    assert 0 < updates_saved(tmp_path / "killed") < whole.updates
    resumed = run(recipe, tmp_path / "killed", resume=True, progress=False)
    assert_same_end(whole.folder, tmp_path / "killed")
    assert (whole.score, whole.steps, whole.updates) == (resumed.score, resumed.steps, resumed.updates)
    assert {row["phase"] for row in rows(whole.folder)} == {"listen", "quantise", "talk", "enforce"}
    assert not (tmp_path / "killed" / (FILE + ".new")).exists()


@pytest.mark.parametrize("update", [1, 6, 10, 12])
def test_a_run_goes_on_from_a_checkpoint_between_checks(recipe, tmp_path, whole, update):
    """Updates 2, 3, 5, 7, 9, 11 and 13 are checks; these are between them, one in each phase."""
    trainer = Trainer(config.load(recipe), tmp_path / "left", tmp_path, checkpoint_every=1)
    trainer.open(resume=False)
    for _ in range(update):
        trainer.advance()
    assert not trainer.just_checked
    assert updates_saved(tmp_path / "left") == update
    run(recipe, tmp_path / "left", resume=True, progress=False)
    assert_same_end(whole.folder, tmp_path / "left")


def test_a_run_killed_between_checks_goes_on_from_there(tmp_path):
    """One phase, checked only at its end, so that any checkpoint before it lies between checks."""
    recipe = tmp_path / "long.toml"
    recipe.write_text(RECIPE.partition("[[phase]]")[0].replace("every = 2", "every = 1000") + ONE_PHASE)
    whole = run(recipe, tmp_path / "whole", progress=False)
    kill_after(recipe, tmp_path / "killed", updates=6, checkpoint_every=3)
    assert 6 <= updates_saved(tmp_path / "killed") < whole.updates
    assert updates_saved(tmp_path / "killed") % 3 == 0
    assert rows(tmp_path / "killed") == []
    run(recipe, tmp_path / "killed", resume=True, progress=False)
    assert_same_end(tmp_path / "whole", tmp_path / "killed")


def test_time_is_counted_over_resumptions(recipe, tmp_path):
    trainer = Trainer(config.load(recipe), tmp_path / "run", tmp_path)
    trainer.open(resume=False)
    for _ in range(3):
        trainer.advance()
    held = read(tmp_path / "run").facts
    assert 0 < held["cpu_s"] <= trainer.clock.cpu_s
    done = run(recipe, tmp_path / "run", resume=True, progress=False)
    spent = [float(row["cpu_s"]) for row in log.read(tmp_path / "run")]
    assert spent == sorted(spent)
    assert held["cpu_s"] < done.cpu_s < held["cpu_s"] + 600
    assert done.cpu_s == pytest.approx(spent[-1], abs=5)
    assert done.log == tmp_path / "run" / "log.csv"


def test_a_log_of_the_first_version_gets_the_new_columns(recipe, tmp_path, whole):
    trainer = Trainer(config.load(recipe), tmp_path / "run", tmp_path)
    trainer.open(resume=False)
    for _ in range(3):
        trainer.advance()
    new = {"cpu_s", "entropy", "decoder", "reward", "drawn_rate"}
    old = [[row[key] for key in row if key not in new] for row in log.read(tmp_path / "run")]
    head = [column for column in log.COLUMNS if column not in new]
    text = "".join(",".join(row) + "\r\n" for row in [head, *old])
    (tmp_path / "run" / log.FILE).write_bytes(text.encode())
    held = read(tmp_path / "run")
    facts = {key: value for key, value in held.facts.items() if key != "cpu_s"}
    write(tmp_path / "run", held.tensors, facts | {"log_bytes": len(text)})
    run(recipe, tmp_path / "run", resume=True, progress=False)
    for one, other in zip(rows(whole.folder), rows(tmp_path / "run"), strict=True):
        assert other == one | (dict.fromkeys(new - {"cpu_s"}, "") if int(one["total"]) <= 3 else {})


def test_a_finished_run_is_only_read(recipe, finished, whole):
    before = (finished / FILE).read_bytes()
    again = run(recipe, finished, resume=True, progress=False)
    assert (finished / FILE).read_bytes() == before
    for name, weight in whole.policy.weights().items():
        assert torch.equal(weight, again.policy.weights()[name])


def test_a_folder_with_a_run_is_not_overwritten_nor_mixed(recipe, finished):
    with pytest.raises(TrainingError, match="holds a run already"):
        run(recipe, finished, progress=False)
    recipe.write_text(RECIPE.replace("seed = 3", "seed = 4"))
    with pytest.raises(TrainingError, match="belongs to another recipe"):
        run(recipe, finished, resume=True, progress=False)


def test_a_damaged_checkpoint_is_named(recipe, finished):
    path = finished / FILE
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(CheckpointError, match=r"checkpoint\.safetensors: damaged"):
        run(recipe, finished, resume=True, progress=False)


def test_a_checkpoint_is_read_whole_while_another_process_replaces_it(tmp_path):
    """Small and large ones take turns, as a run's first one and the next, which holds an optimiser too."""
    sizes = (10, 100_000)
    for size in sizes:
        write(tmp_path, {"weight": torch.full((size,), float(size))}, {"size": size}).rename(
            tmp_path / str(size)
        )
    (tmp_path / FILE).hardlink_to(tmp_path / str(sizes[-1]))
    turns = subprocess.Popen([sys.executable, "-c", TAKE_TURNS, *map(str, sizes)], cwd=tmp_path)
    try:
        while size_read(tmp_path) == sizes[-1]:
            assert turns.poll() is None
        assert {size_read(tmp_path) for _ in range(2000)} == set(sizes)
    finally:
        turns.kill()
        turns.wait()


def size_read(folder: Path) -> int:
    """Size of the weight in the checkpoint, all of which was written at once."""
    tensors, facts = read(folder)
    assert torch.equal(tensors["weight"], torch.full((facts["size"],), float(facts["size"])))
    return facts["size"]


def test_a_missing_start_says_what_to_train_first(recipe, tmp_path):
    recipe.write_text('init_from = "traffic_junction/none"\n' + RECIPE)
    with pytest.raises(TrainingError, match=r"init_from traffic_junction/none: .* train that recipe first"):
        run(recipe, tmp_path / "run", progress=False, bundles=tmp_path)
