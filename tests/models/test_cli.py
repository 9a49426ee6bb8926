import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from models.cli import app
from tests.models.policies.bundles import NAME, tiny_bundle
from tests.models.test_release import RECIPE


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def refused(*words: object) -> str:
    done = run(*words)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    return str(done.stderr)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    tiny_bundle(tmp_path / "bundles")
    return tmp_path / "bundles"


@pytest.mark.parametrize(
    "command", ["train", "evaluate", "interpret", "figures", "release", "reproduce", "bundles"]
)
def test_every_command_explains_itself(command: str) -> None:
    done = run(command, "--help")
    assert done.exit_code == 0
    assert "Usage" in done.stdout


def test_evaluate_prints_one_object_with_intervals(root: Path) -> None:
    done = run("evaluate", NAME, "--bundles", root, "--episodes", 20, "--seed", 4, "--json")
    numbers = json.loads(done.stdout)
    assert numbers["episodes"] == 20
    for name in ("success", "reward", "message_rate", "tokens_used", "steps", "found"):
        assert set(numbers[name]) == {"mean", "ci95"}
        assert numbers[name]["ci95"][0] <= numbers[name]["mean"] <= numbers[name]["ci95"][1]


def test_evaluate_prints_the_same_for_the_same_seed(root: Path) -> None:
    words = ("evaluate", root / NAME, "--episodes", 15, "--sampled", "--json")
    assert run(*words).stdout == run(*words).stdout


def test_evaluate_prints_a_table_for_people(root: Path) -> None:
    done = run("evaluate", NAME, "--bundles", root, "--episodes", 10, "--masked")
    assert done.exit_code == 0
    assert "masked True" in done.stdout
    assert "tokens_used" in done.stdout


def test_evaluate_plays_rules_with_traffic_settings() -> None:
    done = run(
        "evaluate", "scripted:always-gas", "--task", "traffic_junction/medium", "--episodes", 20,
        "--start", "human", "--arrival", 0.01, "--json",
    )  # fmt: skip
    numbers = json.loads(done.stdout)
    assert {"arrived", "collided", "limit"} <= numbers.keys()
    assert (numbers["start"], numbers["arrival"]) == ("human", 0.01)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["nobody"], "nobody: no such bundle; known ones: parent_child/tiny-9"),
        (["scripted:nobody", "--task", "parent_child"], "unknown scripted policy"),
        (["scripted:oracle"], "scripted:oracle needs --task"),
        (["scripted:oracle", "--task", "chess"], "unknown task 'chess'"),
        (["scripted:oracle", "--task", "traffic_junction/easy"], "searches in parent_child"),
        ([NAME, "--task", "traffic_junction/easy"], "was trained for parent_child"),
        ([NAME, "--start", "human"], "has no traffic"),
    ],
)
def test_evaluate_refuses_in_one_line(root: Path, words: list[str], reason: str) -> None:
    assert reason in refused("evaluate", *words, "--bundles", root, "--episodes", 5)


def test_evaluate_names_the_participants_seat_among_all(root: Path) -> None:
    words = ("evaluate", "scripted:random", "--task", "traffic_junction/medium", "--episodes", 20)
    seats = json.loads(run(*words, "--start", "human", "--json").stdout)["seats"]
    assert [seat["seat"] for seat in seats] == list(range(10))
    assert [seat["participant"] for seat in seats] == [False] * 9 + [True]
    assert seats[-1]["cars"] == 20
    assert 0 < seats[0]["collided"]["ci95"][0] <= seats[0]["collided"]["mean"] <= 1
    assert "seat 9 collided (participant)" in run(*words, "--start", "human").stdout
    assert "seats" not in json.loads(run(*words, "--json").stdout)


def test_evaluate_measures_a_run_that_was_never_released(tmp_path: Path) -> None:
    recipe, folder = tmp_path / "short.toml", tmp_path / "run"
    recipe.write_text(RECIPE.format(channel="continuous", tokens=0, updates=1))
    assert "not the folder of a run" not in str(run("train", recipe, "--out", folder).stderr)
    numbers = json.loads(run("evaluate", folder, "--episodes", 20, "--json").stdout)
    assert numbers["task"] == "parent_child"
    assert (numbers["message_rate"]["mean"], numbers["tokens_used"]["mean"]) == (1.0, 0.0)
    (folder / "checkpoint.safetensors").unlink()
    assert "nothing was trained yet" in refused("evaluate", folder)


def test_a_broken_bundle_is_named_with_file_and_reason(root: Path) -> None:
    (root / NAME / "lexicon.json").write_text("{}")
    line = refused("evaluate", NAME, "--bundles", root)
    assert line.startswith("parent_child/tiny-9/lexicon.json: sha256 is not the one")


def test_interpret_writes_lexicon_summary_and_figures(root: Path, tmp_path: Path) -> None:
    out = tmp_path / "meaning"
    done = run("interpret", NAME, "--bundles", root, "--out", out, "--episodes", 200, "--seed", 1)
    assert done.exit_code == 0, done.stderr
    assert sorted(path.name for path in out.iterdir()) == [
        "distances.svg",
        "heatmaps.svg",
        "lexicon.json",
        "null-threshold.svg",
        "null-tokens.svg",
        "prototypes.svg",
        "summary.json",
        "token-use.svg",
        "tokens.csv",
    ]
    assert json.loads((out / "lexicon.json").read_text())["samples"] == 200
    assert "200 messages" in done.stdout
    assert "parent_child: no traffic" in done.stdout


def test_bundles_lists_what_is_whole_and_exits_1_if_any_is_broken(root: Path) -> None:
    whole = run("bundles", "--bundles", root)
    assert whole.exit_code == 0
    assert NAME in whole.stdout
    shutil.copytree(root / NAME, root / "parent_child/copy-9")
    broken = run("bundles", "--bundles", root)
    assert broken.exit_code == 1
    assert NAME in broken.stdout
    assert broken.stderr.startswith("parent_child/copy-9/manifest.json: names")


def test_bundles_of_a_folder_that_does_not_exist_are_bad_input(tmp_path: Path) -> None:
    assert "no such folder" in refused("bundles", "--bundles", tmp_path / "nowhere")


def test_train_and_release_make_a_bundle_that_evaluates(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("models.demands.DEMANDS", {})
    recipe = tmp_path / "short.toml"
    recipe.write_text(RECIPE.format(channel="prototype", tokens=9, updates=1))
    folder, root = tmp_path / "run", tmp_path / "bundles"
    trained = run("train", recipe, "--out", folder, "--seed", 8)
    assert trained.exit_code == 0, trained.stderr
    assert "seed = 8" in (folder / "recipe.toml").read_text()
    released = run("release", folder, "--bundles", root, "--episodes", 10)
    assert released.exit_code == 0, released.stderr
    done = run("evaluate", "parent_child/short-9", "--bundles", root, "--episodes", 5, "--json")
    assert json.loads(done.stdout)["task"] == "parent_child"


def test_a_run_lives_where_runs_that_start_from_it_look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = RECIPE.format(channel="prototype", tokens=9, updates=1)
    Path("short.toml").write_text(text)
    Path("next.toml").write_text('init_from = "run:short"\n' + text)
    assert "runs/short-8" in refused("train", "next.toml", "--seed", 8)
    assert run("train", "short.toml", "--seed", 8).exit_code == 0
    assert run("train", "next.toml", "--seed", 8).exit_code == 0
    assert Path("runs/next-8/log.csv").exists()


def test_train_refuses_what_it_cannot_do_in_one_line(tmp_path: Path) -> None:
    assert "no such file; packaged recipes" in refused("train", "nothing")
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(RECIPE.format(channel="prototype", tokens=9, updates=0))
    assert "wrong.toml: phase.0.updates" in refused("train", wrong, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_folder_that_holds_a_run_is_kept_unless_resumed(tmp_path: Path) -> None:
    recipe, folder = tmp_path / "short.toml", tmp_path / "run"
    recipe.write_text(RECIPE.format(channel="prototype", tokens=9, updates=1))
    run("train", recipe, "--out", folder)
    before = (folder / "checkpoint.safetensors").read_bytes()
    assert "holds a run already" in refused("train", recipe, "--out", folder)
    assert (folder / "checkpoint.safetensors").read_bytes() == before
    assert run("train", recipe, "--out", folder, "--resume").exit_code == 0


def test_release_refuses_bad_names_and_empty_folders(tmp_path: Path) -> None:
    assert "not of the form" in refused("release", tmp_path, "My Bundle")
    assert "not the folder of a run" in refused("release", tmp_path)
