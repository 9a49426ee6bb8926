"""Where training and checks begin: seeds that never meet, and the mixture a recipe asks for."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from models import rng
from models.envs.api import Environment, join
from models.envs.starts import human_start
from models.envs.traffic_junction import TrafficJunction, with_arrival
from models.policies.recurrent import Memory, RecurrentNet
from models.training.config import Start
from models.training.unroll import Beginning, Manner, blank, warmed_up

# Streams over (recipe's seed, update): worlds, arrival probabilities, overrides, torch.
WORLDS, ARRIVALS, OVERRIDES, TORCH = 11, 12, 13, 14
CHECK_SEED = 2**40
"""Checks are held out: the chance that a training seed, a 64-bit word, is one of theirs is below 1e-9."""


def check_seeds(count: int) -> NDArray[np.uint64]:
    """Seeds of the situations on which training judges itself; the same for every recipe."""
    return np.arange(count, dtype=np.uint64) + np.uint64(CHECK_SEED)


def generator(seed: int, update: int) -> torch.Generator:
    """Torch's randomness of one update."""
    return torch.Generator().manual_seed(rng.word(seed, TORCH, update, 0) >> 1)


def uniforms(seed: int, stream: int, update: int, count: int) -> NDArray[np.float64]:
    """Numbers in [0, 1) of one update."""
    words = rng.words(seed, stream, update, np.arange(count))
    return np.asarray((words >> np.uint64(11)).astype(np.float64) / 2.0**53)


def beginning(
    env: Environment[Any],
    net: RecurrentNet,
    start: Start,
    manner: Manner,
    batch: int,
    seed: int,
    update: int,
    draws: torch.Generator,
) -> Beginning:
    """The first states of an update's episodes: those from ``init`` first, then the human trials."""
    seeds = rng.words(seed, WORLDS, update, np.arange(batch))
    humans = round(start.human * batch)
    state = env.init(seeds[: batch - humans])
    if not isinstance(env, TrafficJunction):
        return Beginning(state, None)
    arrival = _arrivals(start, env.arrival, uniforms(seed, ARRIVALS, update, batch))
    state = with_arrival(state, arrival[: batch - humans])
    if not humans:
        return Beginning(state, None)
    begun = human_start(env, seeds[batch - humans :])
    memory = warmed_up(env, net, begun, manner, draws)
    nothing = blank(net, (batch - humans) * env.agents)
    human = with_arrival(begun.state, arrival[batch - humans :])
    both = Memory(*(torch.cat(parts) for parts in zip(nothing, memory, strict=True)))
    return Beginning(join([state, human]), both)


def _arrivals(start: Start, usual: float, draws: NDArray[np.float64]) -> NDArray[np.float64]:
    """Arrival probabilities, even in their logarithm."""
    low, high = start.arrival or (usual, usual)
    return np.asarray(low * (high / low) ** draws)
