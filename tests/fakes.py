"""Doubles that keep the real seams: a policy with memory, a bundle of it with a real lexicon, a lab."""

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy.event import listen

from benchmarks.rounds_only import ROUNDS_ONLY
from models.envs import registry
from models.policies.api import RandomDraws, Speech
from models.policies.bundle import Manifest, PolicyBundle
from models.policies.lexicon import Lexicon
from server.domain import study
from server.services.lab import Lab
from server.services.recent import Recent
from server.settings import Settings
from server.storage.database import Database

STUDIES = Path(__file__).parents[1] / "server" / "studies"
HIDDEN = 8
BUNDLES = {
    "parent_child/prototype-9": ("parent_child", "prototype", 9, 1.0),
    "parent_child/onehot-9": ("parent_child", "one-hot", 9, 1.0),
    "traffic_junction/budget-100": ("traffic_junction/medium", "prototype", 16, 1.0),
    "traffic_junction/budget-050": ("traffic_junction/medium", "prototype", 16, 0.5),
    "traffic_junction/budget-030": ("traffic_junction/medium", "prototype", 16, 0.3),
}


class FakePolicy:
    """Random weights, real memory: what it says and does depends on all that it saw and heard."""

    def __init__(self, observation: int, actions: int, tokens: int, channel: str, seed: int) -> None:
        draw = np.random.default_rng(seed)
        self.channel = channel
        self.tokens = tokens
        self.message_size = tokens
        self.hidden_size = HIDDEN
        self.see = draw.normal(size=(observation, HIDDEN)).astype(np.float32)
        self.say = draw.normal(size=(HIDDEN, tokens)).astype(np.float32)
        self.hear = draw.normal(size=(tokens, HIDDEN)).astype(np.float32)
        self.do = draw.normal(size=(HIDDEN, actions)).astype(np.float32)

    def speak(self, hidden: Any, observation: Any, sampled: RandomDraws | None = None) -> Speech:
        hidden = np.tanh(hidden * np.float32(0.7) + observation @ self.see)
        token = (hidden @ self.say).argmax(1).astype(np.int32)
        return Speech(token, hidden[:, 0] > -0.5, self.vector(token), hidden)

    def act(self, hidden: Any, inbox: Any, sampled: RandomDraws | None = None) -> tuple[Any, Any]:
        hidden = np.tanh(hidden + inbox @ self.hear)
        return (hidden @ self.do).argmax(1).astype(np.int32), hidden

    def vector(self, tokens: Any) -> Any:
        return np.where(tokens[:, None] >= 0, np.eye(self.tokens, dtype=np.float32)[tokens], np.float32(0))


def fake_lexicon(tokens: int, cells: int, seed: int = 0) -> Lexicon:
    """Token k speaks from two or three cells; the last one of many says nothing (null)."""
    draw = np.random.default_rng(seed)
    counts = np.zeros((tokens, cells), np.int64)
    for token in range(tokens):
        counts[token, draw.integers(0, cells, 3)] += 4 * cells
    if tokens > 9:
        counts[-1] = counts[:-1].sum(0)
    return Lexicon.from_counts(counts, draw.random((tokens, 2)), (0.6, 0.3), seed=seed)


def fake_bundle(name: str, seed: int = 1) -> PolicyBundle:
    task, channel, tokens, budget = BUNDLES[name]
    env = registry.make(task)
    policy = FakePolicy(env.observation_size, env.actions, tokens, channel, seed)
    manifest = Manifest(
        format=1,
        name=name,
        task=task,
        task_version=env.version,
        channel=channel,
        gate="open" if budget == 1 else "learned",
        budget=budget,
        sizes={},
        seed=seed,
        steps_trained=0,
        warm_start=None,
        recipe={},
        git_commit="",
        created="2026-11-24T00:00:00Z",
        files={},
    )
    sha256 = hashlib.sha256(f"{name}:{seed}".encode()).hexdigest()
    return PolicyBundle(name, manifest, policy, fake_lexicon(tokens, env.cells, seed), {}, sha256)


class FakeClock:
    """Moves on by `step_s` at every look."""

    def __init__(self, step_s: float = 0.25) -> None:
        self.now = datetime(2026, 11, 24, 12, 0, 0, tzinfo=UTC)
        self.step = timedelta(seconds=step_s)

    def __call__(self) -> datetime:
        self.now += self.step
        return self.now


def hasty(database: Database) -> Database:
    """Without waiting for the disk: tests do not lose power."""
    listen(database.engine, "connect", lambda connection, _: connection.execute("PRAGMA synchronous=OFF"))
    return database


def fake_lab(database: Database, *, cache: int = 64, clock: FakeClock | None = None) -> Lab:
    return Lab(
        settings=Settings(database_url=database.url.render_as_string(hide_password=False)),
        database=database,
        bundles={name: fake_bundle(name) for name in BUNDLES},
        bundle_errors=(),
        secret_key="a secret for tests",
        now=clock or FakeClock(),
        cache=Recent(cache),
    )


def another_worker(lab: Lab, cache: int = 64) -> Lab:
    """A lab on the same database that has seen nothing yet."""
    return replace(lab, cache=Recent(cache), definitions=Recent(8))


def definition(slug: str, *, whole: bool = False, **changes: Any) -> study.StudyDefinition:
    """A packaged study, with some fields changed; short by default.

    Without `whole` it has instructions and rounds, and nothing else. With it, its attention checks come at
    even distances.
    """
    values = tomllib.loads((STUDIES / f"{slug}.toml").read_text())
    values |= {"trials_per_block": 3} | ({} if whole else ROUNDS_ONLY) | changes
    return study.read(with_checks_in_reach(values) if "attention" not in changes else values)


def with_checks_in_reach(values: dict[str, Any]) -> dict[str, Any]:
    """The values of a shortened study whose attention checks still come before its last round."""
    rounds = values["trials_per_block"] * (2 if values["task"] == "parent_child" else 1)
    checks = values["attention"]
    gaps = len(checks) + 1
    spread = [check | {"after": -(-rounds * number // gaps)} for number, check in enumerate(checks, start=1)]
    return values | {"attention": spread}


def timing(rt_ms: float = 412.5, **changes: Any) -> Mapping[str, Any]:
    return {
        "onset_ms": 1000.25,
        "response_ms": 1000.25 + rt_ms,
        "rt_ms": rt_ms,
        "handler_lag_ms": 0.4,
        "wait_ms": None,
        "is_trusted": True,
        "hidden": False,
        "resumed": False,
        "refresh_hz": 60.0,
        "dropped_frames": 0,
        "board_px": 490,
        "early_keys": 0,
        "input": "key",
    } | changes
