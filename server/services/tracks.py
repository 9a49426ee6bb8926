"""Where everybody was in many stored trials at once: worlds replayed side by side along the batch axis.

The log holds actions and messages, not cells: a world is a pure fold over its actions. Trials of one task are
stepped together, so that an export does not pay numpy's price for every trial anew. Nothing is checked here;
that is `hatlab verify`.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from models.envs import registry
from models.envs.api import Environment, take
from models.envs.traffic_junction import TrafficJunction
from server.domain.opening import opening
from server.services.tidy import Entry, Story, Track, world_actions

OPENINGS_KEPT = 8
"""Sets of situations: all people of a study meet the same ones."""
Start = tuple[str, str, float]
"""World, kind of start and arrival: trials that agree in these begin in one batch."""


def entries(stories: Sequence[Story]) -> list[Entry | None]:
    """Give what each driver found on entering; None for other roles."""
    found: list[Entry | None] = [None] * len(stories)
    for start, indices in _by_start(stories):
        env = registry.make(start[0])
        if not isinstance(env, TrafficJunction):
            continue
        state, seats = _openings(start, [stories[i] for i in indices])
        lengths = env.route_length[state.route[np.arange(len(indices)), seats]]
        for index, cars, length in zip(indices, state.alive.sum(1) - 1, lengths, strict=True):
            found[index] = Entry(int(cars), int(length))
    return found


def tracks(stories: Sequence[Story]) -> list[Track]:
    """Replay the trials and give the cells of every seat before and after each world step."""
    found: list[Track | None] = [None] * len(stories)
    for start, indices in _by_start(stories):
        env = registry.make(start[0])
        chosen = [stories[i] for i in indices]
        state, _ = _openings(start, chosen)
        before, after = _replay(env, state, actions := [world_actions(told) for told in chosen])
        for column, (index, own) in enumerate(zip(indices, actions, strict=True)):
            found[index] = Track(before[: len(own), column], after[: len(own), column])
    return cast("list[Track]", found)


def _by_start(stories: Sequence[Story]) -> Iterator[tuple[Start, list[int]]]:
    groups: dict[Start, list[int]] = {}
    for index, told in enumerate(stories):
        spec = told.spec
        groups.setdefault((spec["task"], spec["start"], spec["condition"]["arrival"]), []).append(index)
    yield from groups.items()


def _openings(start: Start, stories: Sequence[Story]) -> tuple[Any, NDArray[np.intp]]:
    """Give the first states, one batch, and the participants' seats."""
    own = [told.spec["seed"] for told in stories]
    seeds = tuple(sorted(set(own)))
    place = {seed: index for index, seed in enumerate(seeds)}
    states = take(_opened(*start, seeds), np.array([place[seed] for seed in own]))
    return states, np.array([told.seat for told in stories])


@lru_cache(maxsize=OPENINGS_KEPT)
def _opened(task: str, start: str, arrival: float, seeds: tuple[int, ...]) -> Any:
    return opening(registry.make(task), start, np.array(seeds, np.uint64), arrival).state


def _replay(
    env: Environment[Any], state: Any, actions: Sequence[Sequence[Sequence[int]]]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Step all worlds together; give the cells before and after as (T, B, N). Ended trials idle along."""
    steps = max((len(own) for own in actions), default=0)
    padded = np.zeros((steps, len(actions), env.agents), np.int32)
    for column, own in enumerate(actions):
        if own:
            padded[: len(own), column] = own
    before, after = np.empty_like(padded), np.empty_like(padded)
    for step in range(steps):
        before[step] = env.cell_of(state)
        state, _ = env.step(state, padded[step])
        after[step] = np.where(env.fresh(state), -1, env.cell_of(state))
    return before, after
