"""What an environment is: a pure, batched world with integer state.

A state is a frozen dataclass of integer and boolean numpy arrays, each with a leading batch axis. `init`,
`step` and `observe` never change their inputs and take randomness only from `models.rng`, so that a world
replays bit for bit from its seed and its actions. Training uses large batches, the server uses B = 1.

Legend: B batch, N agents (seats), A actions, O observation.
"""

from dataclasses import fields
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

S = TypeVar("S")

Seeds = NDArray[np.uint64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]
Floats = NDArray[np.float32]


class Environment(Protocol[S]):
    """One task. `cell = row * columns + column`, counted from the upper left corner."""

    name: str
    version: int
    """Changes only when the same seed and actions would give another world."""
    agents: int
    actions: int
    observation_size: int
    steps_max: int
    shape: tuple[int, int]
    cells: int
    speaks: Bools
    """(N,) which seats may speak at all."""
    message_held: bool
    """True: the first message of an episode is repeated at every step."""
    sought: int | None
    """Seat whose place the others look for; None where there is none."""

    def init(self, seeds: Seeds) -> S:
        """Return the states (B,) in which these episodes begin."""
        ...

    def step(self, state: S, actions: Ints) -> tuple[S, Floats]:
        """Return the next state and the rewards (B, N) for actions (B, N).

        Actions of absent seats are ignored. A done episode stays as it is, with reward 0.
        """
        ...

    def observe(self, state: S) -> Floats:
        """Return what each seat sees (B, N, O); zeros for absent seats."""
        ...

    def alive(self, state: S) -> Bools:
        """Return which seats are occupied (B, N)."""
        ...

    def fresh(self, state: S) -> Bools:
        """Return which seats got a new occupant in this state (B, N): their memory starts from zero."""
        ...

    def cell_of(self, state: S) -> Ints:
        """Return the cell of each seat (B, N), -1 where absent."""
        ...

    def done(self, state: S) -> Bools:
        """Return which episodes are over (B,)."""
        ...

    def success(self, state: S) -> Bools:
        """Return which episodes have gone well so far (B,)."""
        ...


def take(state: S, rows: Any) -> S:
    """Return the episodes `rows` (an index array, slice or mask) of a batch."""
    return type(state)(**{f.name: getattr(state, f.name)[rows] for f in fields(state)})  # type: ignore[arg-type]


def put(state: S, rows: Any, part: S) -> S:
    """Return the batch with the episodes `rows` (an index array or mask) taken from `part`, in order."""
    changed = {f.name: getattr(state, f.name).copy() for f in fields(state)}  # type: ignore[arg-type]
    for name, array in changed.items():
        array[rows] = getattr(part, name)
    return type(state)(**changed)


def where(chosen: Bools, state: S, otherwise: S) -> S:
    """Return a batch that takes each episode from `state` where chosen (B,), else from `otherwise`."""
    picked = {}
    for f in fields(state):  # type: ignore[arg-type]
        one, other = getattr(state, f.name), getattr(otherwise, f.name)
        picked[f.name] = np.where(chosen.reshape(-1, *[1] * (one.ndim - 1)), one, other)
    return type(state)(**picked)


def join(states: list[S]) -> S:
    """Return one batch of all episodes of several batches, in order."""
    kind = type(states[0])
    return kind(**{f.name: np.concatenate([getattr(s, f.name) for s in states]) for f in fields(kind)})  # type: ignore[arg-type]
