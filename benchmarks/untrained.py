"""Agents of the released sizes with weights by chance: they cost what trained ones cost, and exist anywhere.

For measurements of speed and durability only; nothing here says how agents play.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from models.envs import registry
from models.policies import bundle
from models.policies.bundle import Manifest
from models.policies.lexicon import Lexicon
from models.policies.recurrent import Architecture, RecurrentNet, RecurrentPolicy

SEED = 5


class Size(NamedTuple):
    """Name, world, channel, gate, budget, hidden, message, tokens."""

    name: str
    task: str
    channel: str
    gate: str
    budget: float
    hidden: int
    message: int
    tokens: int


SIZES = (
    Size("parent_child/prototype-9", "parent_child", "prototype", "open", 1.0, 64, 9, 9),
    Size("parent_child/onehot-9", "parent_child", "one-hot", "open", 1.0, 64, 9, 9),
    Size("traffic_junction/budget-100", "traffic_junction/medium", "prototype", "open", 1.0, 96, 64, 112),
    Size("traffic_junction/budget-050", "traffic_junction/medium", "prototype", "learned", 0.5, 96, 64, 112),
    Size("traffic_junction/budget-030", "traffic_junction/medium", "prototype", "learned", 0.3, 96, 64, 112),
)


def write(root: Path) -> None:
    """Write the five bundles that the two packaged studies name."""
    for size in SIZES:
        write_bundle(root, size)


def write_bundle(root: Path, size: Size) -> None:
    """Write one bundle by its size."""
    env = registry.make(size.task)
    torch.manual_seed(SEED)
    policy = RecurrentPolicy(
        RecurrentNet(
            Architecture(
                observation_size=env.observation_size,
                actions=env.actions,
                hidden=size.hidden,
                message=size.message,
                tokens=size.tokens,
                channel=size.channel,
                gate=size.gate,
            )
        )
    )
    draw = np.random.default_rng(SEED)
    counts = draw.integers(0, 60, (size.tokens, env.cells))
    lexicon = Lexicon.from_counts(counts, draw.random((size.tokens, 2)), (0.6, 0.3), seed=SEED)
    sizes = policy.architecture.to_dict()
    manifest = Manifest(
        format=bundle.FORMAT,
        name=size.name,
        task=size.task,
        task_version=env.version,
        channel=sizes.pop("channel"),
        gate=sizes.pop("gate"),
        budget=size.budget,
        sizes=sizes,
        seed=SEED,
        steps_trained=0,
        warm_start=None,
        recipe={"task": size.task},
        git_commit="0" * 40,
        created="2026-01-01T00:00:00.000Z",
        files={},
    )
    bundle.save(root, manifest, policy.weights(), lexicon, {}, f"# {size.name}, untrained\n")
