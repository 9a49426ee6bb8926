"""The caution overlay of Traffic Junction: what was just heard, as triangles on the map.

The claim of a triangle is "a car that just spoke may be here". Its likelihood is the lexicon's occupancy of
the messages heard in this state; nothing persists to the next step.
"""

from functools import cache

import numpy as np

from models.envs import registry
from models.envs.traffic_junction import TrafficJunction
from models.policies.lexicon import Lexicon, occupancy
from server.domain.trial import Trial
from server.domain.view import Triangle

DRAWN_MIN = 0.05
"""Least likelihood that is drawn. Source: DESIGN section 5."""
DIGITS = 3

EXAMPLES: tuple[tuple[tuple[int, float], ...], ...] = (
    ((12, 0.62), (17, 0.21)),
    ((25, 0.55), (60, 0.34), (64, 0.12)),
    (),
    ((81, 0.71), (86, 0.18)),
    ((40, 0.4), (44, 0.4), (92, 0.09)),
    ((33, 0.93),),
    (),
    ((5, 0.15), (55, 0.27), (72, 0.5)),
)
"""Practice: (per cent of the way through the road cells, likelihood) by step, again from the first after the
last. They mean nothing."""


def triangles(
    lexicon: Lexicon, tokens: tuple[int, ...], gates: tuple[bool, ...], own: int, columns: int
) -> tuple[Triangle, ...]:
    """What is drawn of these messages, ordered by cell; the own cell is left out."""
    likely = occupancy(lexicon, np.array(tokens, np.int32), np.array(gates, np.bool_))
    likely[own] = 0.0
    cells = np.flatnonzero(likely >= DRAWN_MIN)
    return tuple(Triangle(*divmod(int(cell), columns), round(float(likely[cell]), DIGITS)) for cell in cells)


def messages_drawn(lexicon: Lexicon, tokens: tuple[int, ...], gates: tuple[bool, ...]) -> int:
    """How many of these messages mean something."""
    return sum(gate and not lexicon.null[token] for token, gate in zip(tokens, gates, strict=True))


def examples(trial: Trial) -> tuple[Triangle, ...]:
    """The triangles of a practice round: fixed, whatever happens."""
    cells = road_cells(trial.spec.task)
    shown = {cells[part * len(cells) // 100]: likely for part, likely in EXAMPLES[trial.step % len(EXAMPLES)]}
    return tuple(
        Triangle(*divmod(cell, trial.env.shape[1]), shown[cell])
        for cell in sorted(shown)
        if cell != trial.cell
    )


@cache
def road_cells(task: str) -> tuple[int, ...]:
    env = registry.make(task)
    assert isinstance(env, TrafficJunction)
    return tuple(sorted({int(cell) for route in env.routes for cell in route}))
