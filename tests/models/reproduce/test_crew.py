"""What is missing is run, what is stored is not, and whoever is killed goes on."""

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from models.reproduce import crew
from models.reproduce.cells import Cell, Shelf
from models.reproduce.work import Job, do
from models.training import checkpoint
from tests.models.reproduce.tiny import NAMES, PLAIN, laid_out, shelf_in

ONE, NAMED, LATER = Cell("plain", 1), Cell("names", 1), Cell("later", 1)


def work(shelf: Shelf, *cells: Cell, jobs: int = 1, force: bool = False) -> crew.Report:
    return crew.Crew(shelf, jobs, Console(quiet=True)).work(cells, force)


def changed(shelf: Shelf, recipe: str, before: str, after: str) -> None:
    path = shelf.recipes / f"{recipe}.toml"
    assert before in path.read_text()
    path.write_text(path.read_text().replace(before, after))


@pytest.fixture(scope="module")
def worked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Shelf, crew.Report]:
    """The agent `names`, run from nothing, and so also the one that it starts from."""
    shelf = laid_out(tmp_path_factory.mktemp("tables"))
    return shelf, work(shelf, NAMED, LATER, jobs=2)


@pytest.fixture
def held(worked, tmp_path: Path) -> Shelf:
    """A copy of what was worked, to change."""
    shutil.copytree(worked[0].recipes.parent, tmp_path, dirs_exist_ok=True)
    return shelf_in(tmp_path)


def test_an_agent_is_run_after_the_one_of_the_same_seed_that_it_starts_from(worked) -> None:
    shelf, report = worked
    assert (report.done, report.no_recipe, report.failed) == ([ONE, NAMED], [LATER], {})
    first, second = shelf.record(ONE), shelf.record(NAMED)
    assert second["start"] == first["weights"]
    assert second["training"]["env_steps_before"] == first["training"]["env_steps"] == 25 * 4 * 20
    assert second["training"]["cpu_minutes_before"] == first["training"]["cpu_minutes"] > 0
    assert second["content"]["seed"] == 1
    assert second["views"].keys() == {"greedy", "masked", "sparse"}


def test_what_is_stored_is_not_run_again(worked) -> None:
    shelf, _ = worked
    before = shelf.record_path(NAMED).stat().st_mtime_ns
    report = work(shelf, NAMED)
    assert (report.done, report.fresh) == ([], [NAMED])
    assert shelf.record_path(NAMED).stat().st_mtime_ns == before


def planned(shelf: Shelf, *cells: Cell, force: bool = False) -> list[Cell]:
    plan = crew.Plan(shelf, frozenset(cells) if force else frozenset(), crew.Report())
    assert all(plan.add(cell) for cell in cells)
    return list(plan.steps)


def done(shelf: Shelf, *cells: Cell) -> Shelf:
    """Do some cells in this process."""
    for cell in cells:
        do(Job.of(cell, shelf, train=True))
    return shelf


def test_a_changed_recipe_runs_again_with_all_that_starts_from_it(held: Shelf) -> None:
    shelf = held
    old = shelf.record(ONE)["weights"]
    assert planned(shelf, NAMED) == []
    changed(shelf, "plain", "updates = 25", "updates = 25\nlr = 0.02")
    assert planned(shelf, NAMED) == [ONE, NAMED]
    done(shelf, ONE)
    assert shelf.record(ONE)["weights"] != old
    assert planned(shelf, NAMED) == [NAMED]
    done(shelf, NAMED)
    assert shelf.record(NAMED)["start"] == shelf.record(ONE)["weights"]
    assert (shelf.runs / "plain-1.old1" / checkpoint.FILE).exists()


def test_a_comment_or_a_default_written_out_is_no_change(held: Shelf) -> None:
    (held.recipes / "plain.toml").write_text("# said why\n" + PLAIN + "lr = 1e-3\n")
    assert planned(held, ONE) == []


def test_force_runs_what_was_asked_for_and_nothing_else(held: Shelf) -> None:
    shelf = held
    kept = shelf.record(NAMED)["weights"]
    assert planned(shelf, NAMED, force=True) == [NAMED]
    do(Job.of(NAMED, shelf, force=True))
    assert shelf.record(NAMED)["weights"] == kept  # the same machine, the same weights
    assert (shelf.runs / "names-1.old1").exists()


def test_numbers_without_weights_are_enough_unless_someone_starts_from_them(held: Shelf) -> None:
    (held.runs / "plain-1" / checkpoint.FILE).unlink()
    held.record_path(NAMED).unlink()
    assert planned(held, ONE) == []
    assert planned(held, NAMED) == [ONE, NAMED]


def test_other_numbers_of_episodes_measure_again_and_train_nothing(held: Shelf) -> None:
    shelf, more = held, replace(held, episodes=40)
    before = (shelf.runs / "plain-1" / checkpoint.FILE).stat().st_mtime_ns
    assert planned(more, ONE) == [ONE]
    assert done(more, ONE).record(ONE)["episodes"] == 40
    assert (shelf.runs / "plain-1" / checkpoint.FILE).stat().st_mtime_ns == before


def test_a_failure_is_reported_and_stops_only_what_needs_it(tmp_path: Path) -> None:
    shelf = laid_out(tmp_path)
    (shelf.recipes / "wrong.toml").write_text(PLAIN.replace("hidden = 8", "hidden = 8\nwidth = 1"))
    (shelf.recipes / "names.toml").write_text(NAMES.replace("hidden = 8", "hidden = 9"))
    (shelf.recipes / "orphan.toml").write_text(NAMES.replace("run:plain", "run:nobody"))
    report = work(shelf, Cell("wrong", 1), NAMED, Cell("orphan", 1))
    assert report.done == [ONE]
    assert report.failed[Cell("wrong", 1)] == "wrong.toml: model.width: unknown key"
    assert report.failed[NAMED] == "init_from run:plain: its sizes are not those of [model]"
    assert report.failed[Cell("orphan", 1)] == "starts from nobody-1, which cannot be had"


def test_a_recipe_that_is_changed_while_it_is_trained_is_a_failure_and_no_endless_round(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shelf = laid_out(tmp_path)
    words = ["-c", "import sys; open(sys.argv[1], 'a').write('lr = 1.0')", str(shelf.recipes / "plain.toml")]
    monkeypatch.setattr(Job, "words", lambda _: words)
    assert "was changed meanwhile" in work(shelf, ONE).failed[ONE]


def test_a_cell_that_is_killed_goes_on_and_ends_with_the_same_numbers(worked, tmp_path: Path) -> None:
    whole, shelf = worked[0], laid_out(tmp_path)
    job = Job.of(ONE, shelf)
    process = subprocess.Popen(
        [sys.executable, *job.words()], stdin=subprocess.PIPE, env={**os.environ, "OMP_NUM_THREADS": "1"}
    )
    log = shelf.runs / "plain-1" / "log.csv"
    while process.poll() is None and (not log.exists() or log.read_text().count("\n") < 4):
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert 0 < checkpoint.read(shelf.runs / "plain-1").facts["at"]["total"] < 25
    assert shelf.record(ONE) is None
    do(job)
    one, other = whole.record(ONE), shelf.record(ONE)
    for key in other.keys() - {"training", "date", "git_commit"}:
        assert other[key] == one[key], key
    assert other["training"]["env_steps"] == one["training"]["env_steps"]
    assert other["training"]["cpu_minutes"] > 0


def test_a_child_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    shelf = laid_out(tmp_path)
    changed(shelf, "plain", "updates = 25", "updates = 100000")
    process = subprocess.Popen([sys.executable, *Job.of(ONE, shelf).words()], stdin=subprocess.PIPE)
    log = shelf.runs / "plain-1" / "log.csv"
    while not log.exists():
        time.sleep(0.01)
    assert process.stdin is not None
    process.stdin.close()
    assert process.wait(10) == 1
