"""How the world of a trial begins: a pure function of its spec."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models import rng
from models.envs import starts
from models.envs.api import Environment, Ints, Seeds
from models.envs.traffic_junction import TrafficJunction, TrafficState, with_arrival
from server.domain.errors import CorruptError

ALONE_ROUTE = 32
"""Stream of practice rounds: index 0 the participant's route."""


class Opening(NamedTuple):
    """The first state (B, ...) of trials, and how their worlds came to it."""

    state: Any
    warmup: tuple[tuple[Any, Ints], ...]
    """States before and actions (B, N) taken in them, through which a team is led (`starts.HumanStart`).

    For B > 1 episodes may have warm-ups of different lengths.
    """


def opening(env: Environment[Any], start: str, seeds: NDArray[np.uint64], arrival: float) -> Opening:
    """Begin B trials of these situation seeds.

    Raises:
        CorruptError: this world has no such start.
    """
    if start == "init":
        return Opening(env.init(seeds), ())
    if not isinstance(env, TrafficJunction):
        raise CorruptError(f"{env.name} has no start {start!r}")
    if start == "human":
        begun = starts.human_start(env, seeds, arrival)
        return Opening(begun.state, begun.warmup)
    if start == "alone":
        return Opening(alone(env, seeds), ())
    raise CorruptError(f"{env.name} has no start {start!r}")


def alone(env: TrafficJunction, seeds: Seeds) -> TrafficState:
    """The participant in the last slot at the beginning of a drawn route, and nobody else, ever."""
    empty = with_arrival(env.init(seeds), 0.0)
    last = np.zeros(env.agents, np.bool_)
    last[-1] = True
    drawn = rng.below(rng.words(seeds, ALONE_ROUTE, 0, 0), len(env.routes)).astype(np.int32)
    mine = np.broadcast_to(last, empty.alive.shape)
    return replace(
        empty,
        alive=mine,
        fresh=mine,
        route=np.where(last, drawn[:, None], empty.route),
        guest=np.full_like(empty.guest, env.agents - 1),
    )
