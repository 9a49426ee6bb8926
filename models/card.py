"""The card of a bundle: what a researcher or an ethics board reads before using an agent.

Markdown, made from manifest and evaluation; every number in it was measured when the bundle was released.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from models.policies.bundle import Manifest

TASKS = {
    "parent_child": "Parent & Lost Child: 9x9 grid, at most 20 steps; the child sends one token an episode",
    "predator_prey": "Predator-Prey: predators look for a prey that stays; all talk at every step",
    "traffic_junction": "Traffic Junction: cars that see nobody choose gas or brake and talk at every step",
}
ROWS = {
    "as_trained": "as trained",
    "masked": "messages masked",
    "human": "human trials (5 to 9 other cars)",
    "human_masked": "human trials, messages masked",
}
HOW = {
    "parent_child": "greedy; 95 % interval in brackets. Steps are 20 where the child was not found.",
    "predator_prey": "greedy; 95 % interval in brackets. Reward is summed over the episode, mean over the "
    "predators (the prey gets the same); success means that all predators are with the prey at the end.",
    "traffic_junction": "greedy; 95 % interval in brackets. In human trials arrived, collided and limit are "
    "those of the seat where a participant sits, driven by the policy; success means that no car at all "
    "collided in the whole episode.",
}
COLUMNS = {
    "steps": "steps",
    "found": "found",
    "arrived": "arrived",
    "collided": "collided",
    "limit": "limit",
    "success": "success",
    "reward": "reward",
    "message_rate": "message rate",
    "tokens_used": "tokens in use",
}
SHARES = {"found", "arrived", "collided", "limit", "success", "message_rate"}


def text(manifest: Manifest, evaluation: dict[str, Any]) -> str:
    """Return the card of a bundle with this manifest and evaluation."""
    family = manifest.task.split("/")[0]
    parts = [
        f"# {manifest.name}",
        TASKS[family] + f" (`{manifest.task}`, version {manifest.task_version}).",
        "## What it is",
        _facts(manifest),
        "## How well it does",
        f"{evaluation['episodes']:,} episodes a row, seed {evaluation['seed']}, {HOW[family]}",
        _table(evaluation["rows"]),
        "## What its tokens mean",
        _meaning(evaluation["meaning"]),
        "## Limits",
        _limits(manifest),
    ]
    return "\n\n".join(parts) + "\n"


def _facts(manifest: Manifest) -> str:
    sizes = manifest.sizes
    facts = {
        "channel": f"{manifest.channel}, {sizes['tokens']} tokens of {sizes['message']} numbers",
        "gate": f"{manifest.gate}, budget {manifest.budget:g}",
        "network": manifest.architecture,
        "sizes": ", ".join(f"{name} {size}" for name, size in sorted(sizes.items())),
        "trained": f"{manifest.steps_trained:,} environment steps, seed {manifest.seed}",
        "warm start": manifest.warm_start or "none",
        "supervised help": supervised_help(manifest.recipe),
        "source": source(manifest),
        "made": manifest.created,
    }
    return "\n".join(f"- {name}: {value}" for name, value in facts.items())


def source(manifest: Manifest) -> str:
    """Where the weights come from."""
    if (imported := manifest.recipe.get("imported")) is not None:
        return f"trained elsewhere: {imported['source']}"
    return f"commit {manifest.git_commit}"


def supervised_help(recipe: dict[str, Any]) -> str:
    """What training used besides the reward."""
    if "imported" in recipe:
        return f"{recipe['imported']['supervised_help']} (as its maker says)"
    used = []
    if recipe.get("decoder", {}).get("target", "none") != "none":
        used.append(
            f"{recipe['decoder']['target']} read from messages (information similarity, training only)"
        )
        if recipe["decoder"]["target"] == "coordinates" and recipe["model"]["channel"] == "prototype":
            used.append("messages predicted from coordinates, so that near places get near messages")
    if any(
        phase.get("kind") == "imitate" or phase.get("imitation_weight") for phase in recipe.get("phase", ())
    ):
        used.append("labels of a rule that sees everything")
    return "; ".join(used) or "none"


def _table(rows: dict[str, dict[str, Any]]) -> str:
    columns = [name for name in COLUMNS if any(name in row for row in rows.values())]
    lines = [
        "| | " + " | ".join(COLUMNS[name] for name in columns) + " |",
        "|---|" + "---:|" * len(columns),
    ]
    for key, row in rows.items():
        cells = " | ".join(_cell(name, row.get(name)) for name in columns)
        lines.append(f"| {ROWS.get(key, key)} | {cells} |")
    return "\n".join(lines)


def _cell(name: str, measure: dict[str, Any] | None) -> str:
    if measure is None:
        return "–"
    digits = 3 if name in SHARES else 2
    low, high = measure["ci95"]
    return f"{measure['mean']:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def _meaning(meaning: dict[str, Any]) -> str:
    used, tokens = meaning["tokens_in_use"], meaning["tokens"]
    told, all_bits = meaning["mutual_information_bits"], meaning["cell_entropy_bits"]
    lines = [
        f"- {meaning['messages']:,} messages counted",
        f"- {used} of {tokens} tokens in use, the least used {100 * meaning['least_share_of_use']:.1f} %",
        f"- {meaning['null_tokens']} null tokens, {100 * meaning['null_messages']:.1f} % of the messages",
        f"- a message tells {told:.2f} of the {all_bits:.2f} bits about the cell of its speaker",
    ]
    if meaning["distance_r2"] is not None:
        slope = meaning["distance_slope_cells_per_unit"]
        lines.append(
            "- distance of prototypes against distance of mean locations: "
            f"r² {meaning['distance_r2']:.2f}, slope {slope:.2f} cells per unit, {meaning['pairs']} pairs"
        )
    for truth, words in (("spoke", "cars that just spoke"), ("all_cars", "all other cars")):
        if judged := meaning.get("calibration", {}).get(truth):
            low, high = judged["ece_ci95"]
            lines.append(
                f"- triangles against {words}: calibration error {judged['ece']:.3f} "
                f"[{low:.3f}, {high:.3f}], Brier skill {judged['brier_skill']:.2f}, "
                f"coverage {judged['coverage']:.2f} "
                f"({judged['drawn']:,} cells in {judged['trials']:,} held-out trials)"
            )
    return "\n".join(lines)


def _limits(manifest: Manifest) -> str:
    lines = [
        "- It has only met others of its own kind; how people understand it is what studies are for.",
        "- Its decisions are greedy; floats differ between machines, so a trial stores what was decided.",
    ]
    if manifest.channel == "one-hot":
        lines.append(
            "- One-hot tokens have no geometry: their place on the plane means nothing; a study takes the "
            "places of its panel bundle."
        )
    return "\n".join(lines)
