"""A table says what was not run, sets the paper's figure beside ours, and asks for recipes by name."""

import csv
import shutil
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from models.card import supervised_help
from models.cli import app
from models.reproduce import page, tables
from models.reproduce.cells import Cell
from models.reproduce.lines import Line, convergence, number
from models.reproduce.work import Job, do, drawn_rate
from models.training import config
from tests.models.reproduce.tiny import PLAIN, TABLE, laid_out


def reproduce(folder: Path, *words: str) -> Result:
    places = [
        word for name in ("out", "runs", "recipes", "bundles") for word in (f"--{name}", str(folder / name))
    ]
    return CliRunner().invoke(app, ["reproduce", str(folder / "tiny.toml"), *places, *words])


def rows(text: str) -> dict[str, list[str]]:
    """Cells of a Markdown table by their first."""
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {cells[0]: cells for cells in lines}


@pytest.fixture(scope="module")
def one_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tables")
    shelf = laid_out(folder)
    do(Job.of(Cell("plain", 1), shelf))
    return folder


def test_what_was_not_run_says_so_and_what_has_no_recipe_too(one_run: Path) -> None:
    done = reproduce(one_run, "--no-run")
    assert done.exit_code == 0, done.stderr
    table = rows((one_run / "out/tiny.md").read_text())
    assert table["Plain"][1] == "1 of 2"
    assert table["Names"][1:5] == ["not run", "0.900", "–", "+0.2 M (+3 epochs)"]
    assert table["Later"][1] == "no recipe yet"


def test_ours_stands_beside_the_papers_with_its_interval_and_its_cost(one_run: Path) -> None:
    reproduce(one_run, "--no-run")
    table = rows((one_run / "out/tiny.md").read_text())
    heads, plain = table["method"], table["Plain"]
    cells = dict(zip(heads, plain, strict=True))
    assert cells["success, paper"] == "0.020"
    assert cells["success, ours"].count("[") == 1
    assert cells["converged, ours"].endswith(" M")
    assert (cells["env steps"], cells["CPU-min, public code"]) == ("0.00 M", "≈ 90")
    with (one_run / "out/tiny.csv").open() as file:
        first = next(csv.DictReader(file))
    assert (first["method"], first["paper"], first["n"], first["seeds"]) == ("Plain", "0.02", "1", "1")
    assert float(first["low"]) <= float(first["ours"]) <= float(first["high"])
    assert int(first["converged_paper_env_steps"]) == 160_000
    assert float(first["env_steps"]) == 25 * 4 * 20


def test_a_stored_cell_of_another_recipe_is_not_shown(one_run: Path, tmp_path: Path) -> None:
    shutil.copytree(one_run, tmp_path / "copy")
    path = tmp_path / "copy/recipes/plain.toml"
    path.write_text(path.read_text().replace("updates = 25", "updates = 26"))
    reproduce(tmp_path / "copy", "--no-run")
    assert rows((tmp_path / "copy/out/tiny.md").read_text())["Plain"][1] == "not run"


def test_the_command_runs_what_is_asked_for_and_writes_the_table(tmp_path: Path) -> None:
    laid_out(tmp_path)
    done = reproduce(tmp_path, "--only", "plain", "--seeds", "2")
    assert done.exit_code == 0, done.stderr
    assert "1 done, 0 stored before, 0 no recipe yet, 0 failed" in done.stdout
    assert sorted(path.name for path in (tmp_path / "out/cells").iterdir()) == ["plain-2.json"]
    assert (tmp_path / "out/tiny.md").read_text().count("1 of 2") == 1


def test_a_failure_is_exit_code_1(tmp_path: Path) -> None:
    laid_out(tmp_path)
    (tmp_path / "recipes/plain.toml").write_text("nothing = 1\n")
    done = reproduce(tmp_path, "--only", "plain-1")
    assert (done.exit_code, type(done.exception)) == (1, SystemExit)
    assert "not run" in (tmp_path / "out/tiny.md").read_text()
    assert "plain-1: failed: plain.toml:" in done.stderr


@pytest.mark.parametrize(
    ("words", "reason"),
    [(["--only", "nobody"], "no cell fits"), (["--seeds", "one"], "whole numbers with commas")],
)
def test_bad_input_is_one_line(tmp_path: Path, words: list[str], reason: str) -> None:
    laid_out(tmp_path)
    done = reproduce(tmp_path, *words)
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert reason in done.stderr


def test_an_unknown_table_and_a_wrong_one_are_named(tmp_path: Path) -> None:
    with pytest.raises(tables.TableError, match="no such table; there are human, parent-child, table1"):
        tables.load("table9")
    path = tmp_path / "wrong.toml"
    path.write_text(TABLE.replace("seeds", "sseeds"))
    with pytest.raises(tables.TableError, match=r"wrong.toml: column.0.s?seeds"):
        tables.load(str(path))


@pytest.mark.parametrize("name", ["table1", "table2", "parent-child", "human"])
def test_the_packaged_tables_are_whole(name: str) -> None:
    table = tables.load(name)
    assert table.episodes == 10_000
    keys = {column.key for column in table.column}
    assert all(row.cells.keys() <= keys for row in table.row)
    methods = {row.method for row in table.row}
    assert {entry.of for row in table.row for entry in row.cells.values()} <= {None, *methods}


def test_table_1_asks_for_every_method_on_four_tasks() -> None:
    recipes = {cell.recipe for cell in tables.load("table1").cells()}
    methods = ["none", "fixed-cts", "fixed-proto", "gated-cts", "gated-proto", "onehot"]
    methods += [f"enforcer-{b}" for b in ("090", "070", "050", "030", "020", "010")]
    every = {f"{task}-{m}" for task in ("easy", "medium", "prey5", "prey10") for m in methods}
    assert recipes == every | {"easy-reinforce-only"}


def test_the_reward_is_the_only_help_of_the_row_that_says_so() -> None:
    (cell,) = tables.load("table1").cells("easy-reinforce-only", seeds=(1,))
    recipe = config.load(tables.PACKAGED.parent / "recipes" / f"{cell.recipe}.toml")
    assert (recipe.warm_start, recipe.init_from) == (None, None)
    assert supervised_help(recipe.model_dump(mode="json")) == "none"


def test_a_budget_counts_from_where_it_starts_and_only_if_it_is_kept() -> None:
    column = tables.load("table2").column[0]
    entry = tables.Entry(recipe="x", paper={"views.greedy.success": 0.98}, epochs=35, additional=True)
    curve = [
        "total,env_steps,success,message_rate",
        *(f"{n},{n}000,0.97,{'.9' if n < 5 else '.31'}" for n in range(30)),
    ]
    stored = {"curve": curve, "content": {"budget": 0.3}, "training": {"env_steps_before": 10**6}}
    line = Line("Enforcer-.3", column, entry, "", [1], 1, [stored])
    assert convergence(line) == [5000]
    assert convergence(line._replace(entry=entry.model_copy(update={"additional": False}))) == [1_005_000]
    early = stored | {"curve": curve[:20]}
    never = stored | {"curve": curve[:5]}
    seeds = line._replace(records=[stored, early, never])
    assert convergence(seeds) == [5000, "too short to tell", "never"]


@pytest.mark.parametrize(
    ("lengths", "shown"),
    [
        ([30], "0.02 M"),
        ([30, 8], "0.02 M, 1 of 2"),
        ([30, 8, 20], "0.02 M, 1 of 3, 1 of 3 too short to tell"),
        ([8, 8], "never"),
        ([20, 19], "too short to tell"),
        ([8, 20], "never, 1 of 2 too short to tell"),
    ],
)
def test_a_run_that_ended_while_it_was_good_is_not_said_to_have_never_converged(
    lengths: list[int], shown: str
) -> None:
    """The criterion is met from the tenth evaluation on; runs differ in length."""
    column = tables.load("table1").column[0]
    entry = tables.Entry(recipe="x", paper={"views.greedy.success": 0.98})
    curve = ["total,env_steps,success", *(f"{n},{n}000,{0.5 if n < 10 else 0.98}" for n in range(30))]
    shape = {"content": {"budget": 1.0}, "training": {"env_steps_before": 10_000}}
    records = [shape | {"curve": curve[: 1 + length]} for length in lengths]
    line = Line("", column, entry, "", list(range(len(records))), len(records), records)
    assert page._our_steps(line) == shown


def test_several_seeds_give_mean_and_range_and_one_its_interval() -> None:
    stored = [{"a": {"mean": m, "ci95": [m - 0.1, m + 0.1]}} for m in (0.2, 0.4)]
    assert number(stored, "a") == (pytest.approx(0.3), 0.2, 0.4, "range over seeds")
    assert number(stored[:1], "a") == (0.2, pytest.approx(0.1), pytest.approx(0.3), "95 % over episodes")
    assert number([{"a": 9}], "a") == (9.0, None, None, "")
    assert number(stored, "b") is None


def test_the_drawn_rate_of_a_cell_is_that_of_the_kept_agent_and_only_under_a_budget() -> None:
    rows = [{"best": best, "drawn_rate": rate} for best, rate in (("1", "0.9"), ("1", "0.41"), ("0", "0.3"))]
    free, held = (config.parse(tomllib.loads(text)) for text in (PLAIN, PLAIN + "budget = 0.3\n"))
    assert drawn_rate(held, rows) == 0.41
    assert drawn_rate(free, rows) is None
    assert drawn_rate(held, [{"best": "1"}]) is None  # a log of a version that did not write it


@pytest.mark.parametrize("name", ["table1", "table2"])
def test_the_drawn_rate_stands_beside_the_greedy_one_and_is_a_dash_where_a_cell_lacks_it(name: str) -> None:
    column = tables.load(name).column[0]
    entry = tables.Entry(recipe="x")
    stored = {"training": {"env_steps": 0, "env_steps_before": 0, "cpu_minutes": 0, "cpu_minutes_before": 0},
              "warm_start": None, "supervised_help": "none", "curve": []}  # fmt: skip
    with_it = Line("new", column, entry, "", [1], 1, [stored | {"drawn_rate": 0.731}])
    without = Line("old", column, entry, "", [1], 1, [stored])
    head, _, *lines = page._section(column, [with_it, without]).splitlines()[2:]
    place = rows(head)["method"].index("drawn rate")
    found = rows("\n".join(lines))
    assert (found["new"][place], found["old"][place]) == ("0.731", "–")
