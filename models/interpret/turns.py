"""Every turn to speak that a person would notice: where the speaker was, what it said and did, or silence.

A turn is one step of one living seat that may speak. In human trials of Traffic Junction the participant's
own seat is left out, and what comes after the end of the trial. Where a message is held for the whole episode
there is one turn.

Shapes: T steps, B episodes, N seats, M turns.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from models.envs.starts import has_room
from models.envs.traffic_junction import TrafficJunction
from models.rollout import trials

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from models.envs.api import Environment
    from models.rollout import Rollout


@dataclass(frozen=True, eq=False)
class Turns:
    """One row per turn, every field (M,).

    Attributes:
        episode: number of the episode.
        sent: whether the message was sent.
        token: what was said, or would have been.
        cell: where the speaker was.
        action: what it did in the same step.
        route: on which route it drives; -1 in worlds without routes.
        position: how many cells along it, 0 where it entered; -1 as above.
        entered: whether it appeared in this step; False in the first step of an episode, where nobody knows.
    """

    episode: NDArray[np.int64]
    sent: NDArray[np.bool_]
    token: NDArray[np.int32]
    cell: NDArray[np.int32]
    action: NDArray[np.int32]
    route: NDArray[np.int32]
    position: NDArray[np.int32]
    entered: NDArray[np.bool_]

    def take(self, rows: NDArray[Any]) -> Turns:
        """Return the turns of a mask or of indices."""
        return Turns(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    @classmethod
    def join(cls, parts: Sequence[Turns]) -> Turns:
        """Return all turns of several tables, in order."""
        return cls(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)})


def turns(env: Environment[Any], rollout: Rollout, first: int = 0) -> Turns:
    """List the turns of a rollout whose episodes are numbered from `first` on."""
    at = np.nonzero(chances(env, rollout))
    return Turns(
        episode=at[1].astype(np.int64) + first,
        sent=rollout.gates[at],
        token=rollout.tokens[at],
        cell=rollout.cells[at],
        action=rollout.actions[at],
        route=rollout.routes[at],
        position=rollout.positions[at],
        entered=_entered(rollout)[at],
    )


def chances(env: Environment[Any], rollout: Rollout) -> NDArray[np.bool_]:
    """Return where (T, B, N) somebody has a turn, by the rules at the top."""
    turn = rollout.alive & env.speaks
    if env.message_held:
        turn[1:] = False
    if for_people(env):
        turn[..., -1] = False  # the participant's own seat
        lasts = np.arange(len(turn))[:, None] < trials(rollout).steps  # (T, B)
        turn &= lasts[..., None]
    return turn


def for_people(env: Environment[Any]) -> TypeGuard[TrafficJunction]:
    """Return whether episodes are human trials: traffic with room for them."""
    return isinstance(env, TrafficJunction) and has_room(env)


def _entered(rollout: Rollout) -> NDArray[np.bool_]:
    """Cars that stand where they entered and did not stand there a step before."""
    at_entry = rollout.positions == 0  # (T, B, N)
    entered: NDArray[np.bool_] = at_entry.copy()
    entered[0] = False
    entered[1:] &= ~at_entry[:-1]
    return entered
