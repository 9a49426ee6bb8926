"""A small untrained bundle, and how to spoil it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from models.envs import registry
from models.policies import bundle as bundles
from models.policies.bundle import Manifest, PolicyBundle
from models.policies.lexicon import Lexicon
from models.policies.recurrent import Architecture, RecurrentNet, RecurrentPolicy

TOKENS = 9
NAME = "parent_child/tiny-9"


def tiny_policy(
    task: str = "parent_child", channel: str = "prototype", gate: str = "open"
) -> RecurrentPolicy:
    env = registry.make(task)
    torch.manual_seed(5)
    size = TOKENS if channel == "one-hot" else 6
    architecture = Architecture(env.observation_size, env.actions, 8, size, TOKENS, channel, gate)
    return RecurrentPolicy(RecurrentNet(architecture))


def tiny_lexicon(task: str = "parent_child") -> Lexicon:
    rng = np.random.default_rng(1)
    counts = rng.integers(0, 50, (TOKENS, registry.make(task).cells))
    return Lexicon.from_counts(counts, rng.random((TOKENS, 2)), (0.6, 0.3), seed=1)


def tiny_manifest(policy: RecurrentPolicy, task: str = "parent_child", name: str = NAME) -> Manifest:
    sizes = policy.architecture.to_dict()
    channel, gate = sizes.pop("channel"), sizes.pop("gate")
    return Manifest(
        format=bundles.FORMAT,
        name=name,
        task=task,
        task_version=registry.make(task).version,
        channel=channel,
        gate=gate,
        budget=1.0,
        sizes=sizes,
        seed=5,
        steps_trained=0,
        warm_start=None,
        recipe={"task": task},
        git_commit="0" * 40,
        created="2026-11-24T00:00:00.000Z",
        files={},
    )


def tiny_bundle(root: Path, task: str = "parent_child", name: str = NAME, **policy: str) -> PolicyBundle:
    made = tiny_policy(task, **policy)
    return bundles.save(
        root,
        tiny_manifest(made, task, name),
        made.weights(),
        tiny_lexicon(task),
        {"episodes": 0},
        "# tiny\n",
    )


def rewrite_manifest(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    path = folder / bundles.MANIFEST
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


def replace_file(folder: Path, name: str, content: bytes) -> None:
    """Change a file and let the manifest vouch for it."""
    (folder / name).write_bytes(content)
    rewrite_manifest(folder, lambda data: data["files"].update({name: bundles.sha256(content)}))
