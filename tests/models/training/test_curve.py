"""The learning curve shows the log and never stops a run."""

import logging

import pytest

from models.training import config, curve, log, run
from tests.models.training.small import RECIPE


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    (folder / "small.toml").write_text(RECIPE)
    return run(folder / "small.toml", folder / "run", progress=False)


def test_a_run_leaves_a_curve_with_its_phases_rate_and_budget(trained):
    svg = (trained.folder / curve.FILE).read_text()
    assert svg.startswith("<svg")
    for word in ("traffic_junction/small", "listen", "quantise", "talk", "enforce", "success", "message rate",
                 "budget", "environment steps"):  # fmt: skip
        assert f">{word}<" in svg, word
    assert "human trials" not in svg


def test_its_points_are_the_lines_of_the_log(trained):
    rows = log.read(trained.folder)
    upper = curve.chart(rows, trained.recipe)["datasets"]["success"]
    assert [point["value"] for point in upper] == [float(row["success"]) for row in rows]
    assert [point["env_steps"] for point in upper] == [int(row["env_steps"]) for row in rows]


def test_human_trials_are_drawn_where_there_are_some(trained):
    rows = [row | {"human": "0.5", "arrived": "0.9", "human_rate": "0.4"} for row in log.read(trained.folder)]
    text = str(curve.chart(rows, trained.recipe))
    assert "human trials: arrived" in text
    assert "in human trials" in text


def test_entropy_and_decoder_stand_in_the_log_in_nats(trained):
    rows = log.read(trained.folder)
    assert all(0 < float(row["entropy"]) <= 0.6932 for row in rows)  # two actions: at most ln 2
    decoders = {row["phase"]: row["decoder"] for row in rows}
    assert float(decoders["listen"]) > 1  # summed over the cells, without its weight of .1
    assert decoders["talk"] == ""


@pytest.mark.parametrize("content", [None, "", "phase\nlisten\n", "not,a log\n1,2\n"])
def test_a_curve_that_cannot_be_drawn_is_a_warning(tmp_path, caplog, content):
    recipe = tmp_path / "small.toml"
    recipe.write_text(RECIPE)
    if content is not None:
        (tmp_path / log.FILE).write_text(content)
    with caplog.at_level(logging.WARNING):
        curve.draw(tmp_path, config.load(recipe))
    assert not (tmp_path / curve.FILE).exists()
    assert bool(caplog.records) == (content != "")


def test_a_run_ends_well_though_its_curve_cannot_be_written(tmp_path):
    recipe = tmp_path / "small.toml"
    recipe.write_text(RECIPE)
    (tmp_path / "run" / curve.FILE).mkdir(parents=True)
    assert run(recipe, tmp_path / "run", progress=False).updates == 13
