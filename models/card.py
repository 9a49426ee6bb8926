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
NAMED = 24
"""Up to so many tokens each is listed."""
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
    lines = [
        f"{meaning['messages']:,} messages counted",
        f"{used} of {tokens} tokens in use, the least used {100 * meaning['least_share_of_use']:.1f} %",
        *meaning_lines(meaning),
    ]
    return "\n".join(f"- {line}" for line in lines)


def meaning_lines(meaning: dict[str, Any]) -> list[str]:
    """Return what is known about a language (`models.interpret.summary`), a line per finding."""
    lines = [_nulls(meaning), _place(meaning), *_entropies(meaning), *_distance(meaning)]
    if found := meaning.get("traffic"):
        lines += _on_the_road(found)
    if burst := meaning.get("bursts"):
        single = burst["single_quantiles"]
        lines.append(
            "message rate in stretches of 5 steps, all episodes: "
            f"{burst['least']:.2f} to {burst['most']:.2f}; of single episodes: {single['q05']:.2f} to "
            f"{single['q95']:.2f} in 90 % of stretches"
        )
    lines += _removed(meaning.get("null_removed"))
    return lines + _overlay(meaning.get("calibration", {}))


def _nulls(meaning: dict[str, Any]) -> str:
    why = meaning["null_why"]
    return (
        f"{meaning['null_tokens']} null tokens, {100 * meaning['null_messages']:.1f} % of the messages "
        f"({why['never_said']} never said, {why['rare']} too rarely, {why['vague']} vague)"
    )


def _place(meaning: dict[str, Any]) -> str:
    told, all_bits = meaning["mutual_information_bits"], meaning["cell_entropy_bits"]
    return f"a message tells {told:.2f} of the {all_bits:.2f} bits about the cell of its speaker"


def _entropies(meaning: dict[str, Any]) -> list[str]:
    """Entropy of the place by token, of the tokens that are not null; of many, only from least to most."""
    each = meaning["token_entropy_bits"]
    if not each:
        return []
    values = sorted(each.values())
    line = (
        f"bits left open about the cell: by tokens that say where {values[0]:.2f} to {values[-1]:.2f}, by a "
        f"message on average {meaning['mean_entropy_bits']:.2f}"
    )
    if len(each) <= NAMED:
        line += f" (token {', '.join(f'{token}: {bits:.2f}' for token, bits in each.items())})"
    return [line]


def _distance(meaning: dict[str, Any]) -> list[str]:
    words = "distance of prototypes against distance of mean locations"
    if meaning["distance_reason"]:
        return [f"{words}: {meaning['distance_reason']}"]
    r2 = f"{meaning['distance_r2']:.2f}{_range(meaning['distance_r2_ci95'])}"
    slope = f"{meaning['distance_slope_cells_per_unit']:.2f}{_range(meaning['distance_slope_ci95'])}"
    return [f"{words}: r² {r2}, slope {slope} cells per unit, {meaning['pairs']} pairs"]


def _range(interval: tuple[float, float] | None) -> str:
    return "" if interval is None else f" [{interval[0]:.2f}, {interval[1]:.2f}]"


def _on_the_road(found: dict[str, Any]) -> list[str]:
    bits, lanes = found["information"], found["shared_between_lanes"]
    told = ", ".join(
        f"{name} {bits[name]['bits']:.2f} of {bits[name]['entropy_bits']:.2f}"
        for name in ("lane", "arrival", "route", "action")
    )
    entering, cell = found["rate_entering"], bits["action_from_cell"]["bits"]
    lines = [
        f"bits that a message tells of its speaker: {told} (the cell alone tells {cell:.2f} of the action)"
    ]
    lines.append(f"{lanes['tokens']} of {lanes['of']} tokens are said on more than one lane")
    if entering is not None:
        lines.append(
            f"a car speaks in {100 * entering['mean']:.1f} % of the steps in which it appears, in "
            f"{100 * found['rate']['mean']:.1f} % of all its steps"
        )
    return lines


def _removed(found: dict[str, Any] | None) -> list[str]:
    """Success and message rate with and without null messages."""
    if found is None:
        return []
    lines = []
    for start, when in found.items():
        name = "arrived" if "arrived" in when["before"] else "success"
        pairs = [
            f"{said} {when['before'][key]['mean']:.3f} before, {when['after'][key]['mean']:.3f} after"
            for said, key in ((name, name), ("message rate", "message_rate"))
        ]
        lines.append(f"null messages not sent ({'human trials' if start == 'human' else 'as trained'}): ")
        lines[-1] += "; ".join(pairs)
    return lines


def _overlay(calibration: dict[str, Any]) -> list[str]:
    lines = []
    for truth, words in (("spoke", "cars that just spoke"), ("all_cars", "all other cars")):
        if judged := calibration.get(truth):
            low, high = judged["ece_ci95"]
            lines.append(
                f"triangles against {words}: calibration error {judged['ece']:.3f} "
                f"[{low:.3f}, {high:.3f}], Brier score {judged['brier']:.4f}, skill "
                f"{judged['brier_skill']:.2f}, coverage {judged['coverage']:.2f} "
                f"({judged['drawn']:,} cells in {judged['trials']:,} held-out trials)"
            )
    return lines


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
