"""The page of released agents: read from bundles, one row each."""

import json
from pathlib import Path

from models import roster


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


def test_a_house_without_agents_has_empty_tables(tmp_path: Path) -> None:
    assert "## parent_child" in roster.page(tmp_path)
