"""Short recipes, one for each family of the packaged ones."""

from pathlib import Path

from models.training import TrainingResult, run

TRAFFIC = """
name = "traffic_junction/short"
task = "traffic_junction/easy"
seed = 1
{start}
[model]
hidden = 32
message = 16
{model}
[start]
arrival = [0.1, 0.5]
[decoder]
target = "{target}"
reads = "inbox"
[check]
every = 1000
episodes = 200
"""
IMITATE = """
[[phase]]
name = "imitate"
kind = "imitate"
episodes = 32
window = 5
brake_weight = 2.0
careful = false
lr = {lr}
lr_end = {lr_end}
updates = {updates}
"""
ENFORCE = """
[[phase]]
name = "talk"
updates = 1
episodes = 80
gate = "rewarded"
[[phase]]
name = "enforce"
updates = 50
episodes = 80
lr = 5e-3
gate = "enforced"
budget = 0.5
gate_weight = 20.0
gamma = 0.5
lam = 0.5
entropy = 0.001
first_collision_only = true
shared = 0.3
"""


def traffic(model: str, *phases: str, target: str = "occupancy", start: str = "") -> str:
    """A recipe for drivers on the easy crossing."""
    return TRAFFIC.format(model=model, target=target, start=start) + "".join(phases)


def imitate(updates: int, lr: float, lr_end: float, more: str) -> str:
    """A phase in which a rule is imitated."""
    return IMITATE.format(updates=updates, lr=lr, lr_end=lr_end) + more


PROTOTYPES = 'tokens = 16\nchannel = "prototype"'
GATED = f'{PROTOTYPES}\ngate = "learned"'
FROM_BASE = 'init_from = "run:base"'

FIXED_PROTO = traffic(
    PROTOTYPES,
    imitate(50, 4e-3, 1e-3, "rule_share = 0.5\ndecoder_weight = 0.1\ndiscrete = false"),
    imitate(40, 2e-3, 2e-4, "decoder_weight = 0.1"),
)
ONE_HOT = traffic(
    'tokens = 16\nchannel = "one-hot"', imitate(60, 4e-3, 1e-3, "rule_share = 0.5\ndecoder_weight = 0.1")
)
NO_COMMUNICATION = traffic('channel = "none"', imitate(60, 4e-3, 1e-3, "rule_share = 0.5"), target="none")
BUDGET = traffic(
    GATED, imitate(30, 2e-3, 2e-4, 'gate = "budget"\nbudget = 0.5\ngate_weight = 5.0'), start=FROM_BASE
)
ENFORCER = traffic(GATED, ENFORCE, start=FROM_BASE)


def trained(folder: Path, recipe: str) -> TrainingResult:
    """Follow a recipe in a folder; runs that start from each other lie side by side."""
    folder.mkdir()
    path = folder / "recipe.toml"
    path.write_text(recipe)
    return run(path, folder, progress=False)
