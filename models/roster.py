"""The released agents side by side: `docs/released-agents.md` is this module printed (`make docs`).

Every number is read from the `evaluation.json` of a bundle, where `hatlab release` wrote it.
"""

import json
from pathlib import Path
from typing import Any

from models.card import SHARES

BUNDLES = Path(__file__).parent / "bundles"
HEAD = """# Released agents

This page is printed by `python -m models.roster` (`make docs`). Its numbers stand in the `evaluation.json` of
each bundle. `hatlab release` measured them, as `hatlab evaluate BUNDLE --seed 7 --episodes N` does (with
`--masked` or `--start human` where the column says so). In brackets the 95 % interval. Agents are greedy.
*Masked*: nobody hears anything. How each was trained, with which supervised help, and what its tokens mean,
stands on its card, `CARD.md` beside its weights. What rules reach without learning:
[measurements](measurements.md).
"""
ABOUT = {
    "parent_child": "Parent & Lost Child. Steps are 20 where the child was not found; 6 is the floor.",
    "traffic_junction": """\
Traffic Junction. Success: no car collided in the whole episode. *Human trials* begin among 5 to 9 driving
cars; *arrived* is the car in the participant's seat, here driven by the policy.""",
    "predator_prey": """\
Predator-Prey. *Reward* is summed over an episode, mean over the predators;
success: all are on the prey at the end. Rewards of different grids do not compare.""",
}
COLUMNS = {
    "parent_child": {
        "steps": ("as_trained", "steps"),
        "found": ("as_trained", "found"),
        "steps, masked": ("masked", "steps"),
        "found, masked": ("masked", "found"),
        "tokens in use": ("as_trained", "tokens_used"),
    },
    "traffic_junction": {
        "success": ("as_trained", "success"),
        "success, masked": ("masked", "success"),
        "human trials: arrived": ("human", "arrived"),
        "arrived, masked": ("human_masked", "arrived"),
        "human trials: success": ("human", "success"),
        "message rate": ("as_trained", "message_rate"),
    },
    "predator_prey": {
        "reward": ("as_trained", "reward"),
        "reward, masked": ("masked", "reward"),
        "success": ("as_trained", "success"),
        "message rate": ("as_trained", "message_rate"),
        "tokens in use": ("as_trained", "tokens_used"),
    },
}
"""By task folder: heading, and row and measure of evaluation.json."""
OF_ANY_TASK = {
    "success": ("as_trained", "success"),
    "success, masked": ("masked", "success"),
    "reward": ("as_trained", "reward"),
    "reward, masked": ("masked", "reward"),
    "message rate": ("as_trained", "message_rate"),
}
"""The same for a task that nobody has described here: what every evaluation holds."""


def page(root: Path = BUNDLES) -> str:
    """Give the whole page: a table for each task that has agents, described tasks first."""
    agents = {task: _agents(root / task) for task in [*COLUMNS, *_others(root)]}
    return "\n".join([HEAD, *(table(task, folders) for task, folders in agents.items() if folders)])


def _others(root: Path) -> list[str]:
    return sorted(folder.name for folder in root.glob("*/") if folder.name not in COLUMNS)


def _agents(task: Path) -> list[Path]:
    return sorted(path.parent for path in task.glob("*/manifest.json"))


def table(task: str, folders: list[Path]) -> str:
    """Give the section of one task."""
    columns = COLUMNS.get(task, OF_ANY_TASK)
    head = ["agent", "warm start", "episodes", *columns]
    about = [ABOUT[task], ""] if task in ABOUT else []
    rule = "|---|---|" + "---:|" * (len(head) - 2)
    lines = [line(folder, columns) for folder in folders]
    return "\n".join([f"## {task}", "", *about, f"| {' | '.join(head)} |", rule, *lines, ""])


def line(folder: Path, columns: dict[str, tuple[str, str]]) -> str:
    """One agent as a row of its task's table."""
    evaluation, manifest = (
        json.loads((folder / file).read_text(encoding="utf-8"))
        for file in ("evaluation.json", "manifest.json")
    )
    rows = evaluation["rows"]
    cells = [cell(rows.get(row, {}).get(measure), measure) for row, measure in columns.values()]
    start = manifest["warm_start"] or "none"
    episodes = f"{evaluation['episodes']:,}"
    return f"| {' | '.join([f'`{folder.name}`', start, episodes, *cells])} |"


def cell(measure: dict[str, Any] | None, name: str) -> str:
    """A measure with its interval; a dash where nobody measured it."""
    if measure is None:
        return "–"
    digits = 3 if name in SHARES else 2
    low, high = measure["ci95"]
    return f"{measure['mean']:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


if __name__ == "__main__":
    print(page(), end="")
