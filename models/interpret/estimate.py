"""Make a lexicon: let a policy live in the situations that people meet, and count where it was when it spoke.

Traffic Junction: human-trial starts, the policy in every seat; counted is what the participant's seat would
hear while its trial lasts. (Easy has no room for human trials: its own starts, every message of every seat.)
Parent & Lost Child: random starts; the child's one message of each episode.
Predator-Prey: random starts; every message of every seat.

Shapes: T steps, B episodes, N seats, K tokens, C cells.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from models import rng
from models.bursts import Windows, windows
from models.interpret.plane import drawn, principal
from models.interpret.turns import Turns, chances, for_people, turns
from models.policies.lexicon import Lexicon
from models.policies.team import Team
from models.rollout import Rollout, episodes

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from models.envs.api import Environment
    from models.policies.api import Policy

ESTIMATION, HELD_OUT, EVALUATION = 201, 202, 203
"""Streams of episode seeds: what is estimated on one is never judged on the same episodes."""

BATCH = 500
EPISODES = {"traffic_junction": 2_000, "predator_prey": 2_000, "parent_child": 20_000}
"""Episodes of a lexicon: enough to see every cell often (a search gives one message, a trial hundreds)."""


def estimate(env: Environment[Any], policy: Policy, count: int, seed: int) -> Lexicon:
    """Estimate what the tokens of a policy mean from `count` episodes.

    Raises:
        ValueError: the policy has no tokens.
    """
    return lexicon(env, policy, listen(env, policy, count, seed).turns, seed)


class Heard(NamedTuple):
    """What was noted while a policy lived."""

    turns: Turns
    """Of the seats and steps that a person notices."""
    windows: Windows
    """Of all seats, over whole episodes."""


def listen(env: Environment[Any], policy: Policy, count: int, seed: int) -> Heard:
    """Let a policy live in the episodes that lexicons are estimated from.

    Raises:
        ValueError: the policy has no tokens.
    """
    if policy.tokens == 0:
        raise ValueError(f"a {policy.channel} channel has no tokens to interpret")
    parts, counted, first = [], [], 0
    for rollout in lives(env, policy, count, seed, ESTIMATION):
        parts.append(turns(env, rollout, first))
        counted.append(windows(rollout, env.speaks))
        first += rollout.cells.shape[1]
    sent, living = (np.concatenate(column) for column in zip(*counted, strict=True))
    return Heard(Turns.join(parts), Windows(sent, living))


def lexicon(env: Environment[Any], policy: Policy, taken: Turns, seed: int) -> Lexicon:
    """Make the table of what was said where."""
    said = taken.take(taken.sent)
    counts = np.zeros((policy.tokens, env.cells), np.int64)
    np.add.at(counts, (said.token, said.cell), 1)
    components = principal(vectors(policy), counts.sum(axis=1) > 0)
    return Lexicon.from_counts(
        counts,
        positions=drawn(components.coordinates),
        explained=components.explained,
        seed=seed,
        coordinates=components.coordinates,
    )


def lives(
    env: Environment[Any], policy: Policy, count: int, seed: int, stream: int, batch: int = BATCH
) -> Iterator[Rollout]:
    """Play `count` episodes of the kind that people meet, greedily, batch by batch."""
    team = Team(env, policy)
    start: Literal["init", "human"] = "human" if for_people(env) else "init"
    for seeds in seed_batches(count, seed, stream, batch):
        yield episodes(env, team, seeds, start=start)


def seed_batches(count: int, seed: int, stream: int, batch: int = BATCH) -> Iterator[NDArray[np.uint64]]:
    """Episode seeds in batches; episode i has the same seed whatever the batch size."""
    for first in range(0, count, batch):
        yield rng.words(seed, stream, 0, np.arange(first, min(first + batch, count), dtype=np.uint64))


def hearable(env: Environment[Any], rollout: Rollout) -> NDArray[np.bool_]:
    """Return which messages (T, B, N) a person would hear: of those that might be sent, gate open."""
    return chances(env, rollout) & rollout.gates


def vectors(policy: Policy) -> NDArray[np.float64]:
    """Message vectors of all tokens, (K, D)."""
    return policy.vector(np.arange(policy.tokens, dtype=np.int32)).astype(np.float64)
