"""Worlds of fixed seeds, written down once: a stored trial means the same for ever.

A difference here is a change of what seeds and actions mean. Then the environment gets a new version and an
entry of its own (run this file as a program to see the entries of today), and the old entry goes only with
the old version.
"""

import hashlib
import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from models import rng
from models.envs.registry import NAMES, make
from models.envs.starts import human_start
from models.policies import scripted

WORLDS = Path(__file__).with_name("worlds.json")
SEEDS = np.array([0, 1, 2, 7, 20261124, 2**63, 2**64 - 1], np.uint64)


def _hash(digest: Any, *arrays: np.ndarray) -> None:
    for array in arrays:
        digest.update(repr(array.shape).encode())
        digest.update(array.astype("<u8" if array.dtype == np.uint64 else "<i8").tobytes())


def _play(env: Any, state: Any) -> dict[str, Any]:
    """Return the digest of everything that random actions bring about, and one episode's cells to read."""
    digest, policy, cells = hashlib.sha256(), scripted.make("scripted:random"), []
    for _ in range(env.steps_max):
        cells.append(env.cell_of(state)[0].tolist())
        actions = policy.actions(env, state)
        state, reward = env.step(state, actions)
        _hash(digest, *[getattr(state, field.name) for field in fields(state)], actions)
        _hash(digest, np.rint(reward * 100), np.rint(env.observe(state) * 1e4))
    return {"sha256": digest.hexdigest(), "cells": cells[:12]}


def _entries() -> dict[str, Any]:
    entries: dict[str, Any] = {"rng": [rng.word(7, stream, step, 3) for stream in (1, 2) for step in (0, 1)]}
    for name in NAMES:
        env = make(name)
        entries[f"{name} v{env.version}"] = _play(env, env.init(SEEDS))
    for name in ("traffic_junction/medium", "traffic_junction/hard"):
        env = make(name)
        begun = human_start(env, SEEDS)
        entry = _play(env, begun.state)
        entries[f"{name} v{env.version} human start"] = {
            **entry,
            "length": begun.length.tolist(),
            "cars": begun.cars.tolist(),
        }
    return entries


@pytest.fixture(scope="module")
def today() -> dict[str, Any]:
    return _entries()


def test_every_world_is_what_it_always_was(today: dict[str, Any]) -> None:
    for name, entry in json.loads(WORLDS.read_text()).items():
        assert today[name] == entry, name


def test_every_world_of_today_is_written_down(today: dict[str, Any]) -> None:
    assert set(today) == set(json.loads(WORLDS.read_text()))


if __name__ == "__main__":
    lines = (f"{json.dumps(name)}: {json.dumps(entry)}" for name, entry in _entries().items())
    print("{" + ",\n".join(lines) + "}")
