"""The page of released agents: read from bundles, one row each."""

import json
from pathlib import Path

from models import roster
from models.envs import registry


def bundle(root: Path, name: str, rows: dict[str, dict[str, float]]) -> None:
    folder = root / name
    folder.mkdir(parents=True)
    measured = {
        row: {key: {"mean": mean, "ci95": [mean, mean]} for key, mean in measures.items()}
        for row, measures in rows.items()
    }
    evaluation = {"episodes": 5_000, "rows": measured}
    (folder / "evaluation.json").write_text(json.dumps(evaluation))
    (folder / "manifest.json").write_text(json.dumps({"warm_start": None}))


def test_an_agent_is_a_row_of_its_task(tmp_path: Path) -> None:
    rows = {
        "as_trained": {"steps": 6.391, "found": 0.9996, "tokens_used": 9},
        "masked": {"steps": 15.6, "found": 0.33},
    }
    bundle(tmp_path, "parent_child/signs-9", rows)

    page = roster.page(tmp_path)

    assert (
        "| `signs-9` | none | 5,000 | 6.39 [6.39, 6.39] | 1.000 [1.000, 1.000] | 15.60 [15.60, 15.60] "
        "| 0.330 [0.330, 0.330] | 9.00 [9.00, 9.00] |"
    ) in page
    assert page.count("signs-9") == 1


def test_predator_prey_has_its_own_table_of_rewards(tmp_path: Path) -> None:
    trained = {"reward": 2.18, "success": 0.99, "message_rate": 1.0, "tokens_used": 12}
    bundle(tmp_path, "predator_prey/prey5", {"as_trained": trained, "masked": {"reward": -0.4}})

    page = roster.page(tmp_path)

    assert "Predator-Prey. *Reward* is summed" in page
    assert (
        "| `prey5` | none | 5,000 | 2.18 [2.18, 2.18] | -0.40 [-0.40, -0.40] | 0.990 [0.990, 0.990] "
        "| 1.000 [1.000, 1.000] | 12.00 [12.00, 12.00] |"
    ) in page


def test_a_task_that_nobody_described_has_a_table_too_with_dashes_for_what_nobody_measured(
    tmp_path: Path,
) -> None:
    bundle(tmp_path, "hide_and_seek/first", {"as_trained": {"success": 0.5, "reward": 1.0}})
    bundle(tmp_path, "parent_child/signs-9", {"as_trained": {"steps": 6.4}})

    page = roster.page(tmp_path)

    assert "| `first` | none | 5,000 | 0.500 [0.500, 0.500] | – | 1.00 [1.00, 1.00] | – | – |" in page
    assert page.index("## parent_child") < page.index("## hide_and_seek")


def test_every_registered_task_is_described() -> None:
    assert {name.split("/")[0] for name in registry.NAMES} == roster.ABOUT.keys() == roster.COLUMNS.keys()


def test_a_task_without_agents_has_no_table(tmp_path: Path) -> None:
    (tmp_path / "parent_child").mkdir()
    assert roster.page(tmp_path) == roster.HEAD
