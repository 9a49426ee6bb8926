"""Episodes of any drivers or seekers in any world, batched: what everything above counts from.

Shapes by legend: T steps, B episodes, N seats. Everything that stands at step t was true, said or done in the
state of step t; ``rewards`` are what the actions of step t led to.
"""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from models.envs.api import Environment, take
from models.envs.starts import ARRIVAL, HumanStart, human_start
from models.envs.traffic_junction import TrafficJunction, with_arrival
from models.policies.team import Memory, Talk, Team
from models.vocabulary import SILENT

Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]


class Scripted(Protocol):
    """A rule in every seat; see ``models.policies.scripted``."""

    name: str

    def actions(self, env: Any, state: Any) -> Ints: ...


@dataclass(frozen=True, slots=True)
class Rollout:
    """What happened in B episodes."""

    cells: Ints
    """(T, B, N) cell of each seat, -1 absent."""
    alive: Bools
    """(T, B, N) seats that lived and whose episode was not over."""
    tokens: Ints
    """(T, B, N) what each seat would say; SILENT where it says nothing or the channel has no codebook."""
    gates: Bools
    """(T, B, N) whether it was sent."""
    actions: Ints
    """(T, B, N)"""
    rewards: NDArray[np.float32]
    """(T, B, N)"""
    collided: Bools
    """(T + 1, B, N) seats that share a cell, first state and last included; all False in worlds without
    collisions.
    """
    completed: Bools
    """(T + 1, B, N) seats whose car left by the end of its route in the step that led here."""
    success: Bools
    """(B,) as the world judges the whole episode."""
    steps: Ints
    """(B,) steps until the episode was over."""
    cars: Ints
    """(B,) seats that lived in the first state."""
    routes: Ints
    """(T, B, N) route of each living car; -1 elsewhere, and in worlds without routes."""
    positions: Ints
    """(T, B, N) how far along its route it is, 0 where it entered; -1 as above."""

    @property
    def message_rate(self) -> float:
        """Messages sent per living agent and step; nan if nobody lived."""
        living = int(self.alive.sum())
        return float((self.gates & self.alive).sum() / living) if living else float("nan")


class Trials(NamedTuple):
    """How a rollout from human-trial starts went for the last seat, where a participant would sit."""

    arrived: Bools
    """(B,) reached the end of its route without ever sharing a cell."""
    collided: Bools
    """(B,) shared a cell before it could leave: the trial's end."""
    steps: Ints
    """(B,) decisions until collision or arrival, or the limit."""
    others: Bools
    """(B,) two other cars shared a cell while the trial went on."""


def episodes(
    env: Environment[Any],
    players: Team | Scripted,
    seeds: NDArray[np.uint64],
    start: Literal["init", "human"] = "init",
    arrival: float | None = None,
    masked: bool = False,
) -> Rollout:
    """Play one episode per seed.

    Args:
        env: the world.
        players: a team (which decides greedily, or sampled if it was given draws), or a rule.
        seeds: (B,) of the episodes; with ``start="human"`` the situations.
        start: ``init`` or, in Traffic Junction, ``human``: among 5-9 cars, the participant in the last slot.
        arrival: probability that a car arrives at an entrance in a step, if it is not to be the world's own.
        masked: nobody hears anything.

    Raises:
        ValueError: a human start or an arrival probability was asked for in a world without traffic.
    """
    state, memory = begin(env, players, seeds, start, arrival)
    record = _Record(env)
    for _ in range(env.steps_max):
        talk, memory = _talk(players, state, memory)
        if masked and talk is not None:
            talk = talk._replace(gates=np.zeros_like(talk.gates))
        actions, memory = _decide(env, players, state, memory, talk)
        after, reward = env.step(state, actions)
        record.add(state, talk, actions, reward, after)
        state = after
    return record.rollout(state)


def trials(rollout: Rollout) -> Trials:
    """Judge each episode as a participant's trial: over at the own collision, arrival or the limit."""
    collided, completed = rollout.collided[..., -1], rollout.completed[..., -1]  # (T + 1, B)
    last = len(collided) - 1
    hit = np.where(collided.any(0), collided.argmax(0), last + 1)
    home = np.where(completed.any(0), completed.argmax(0), last + 1)
    steps = np.minimum(np.minimum(hit, home), last).astype(np.int32)
    during = np.arange(last + 1)[:, None] <= steps
    others = (rollout.collided[..., :-1].sum(2) >= 2) & during
    return Trials(home < hit, (hit < home) & (hit <= last), steps, others.any(0))


def begin(
    env: Environment[Any],
    players: Team | Scripted,
    seeds: NDArray[np.uint64],
    start: Literal["init", "human"] = "init",
    arrival: float | None = None,
) -> tuple[Any, Memory | None]:
    """The first states of the episodes and what a team remembers there (None for a rule)."""
    team = players if isinstance(players, Team) else None
    if start == "human":
        begun = human_start(_traffic(env), seeds, ARRIVAL if arrival is None else arrival)
        return begun.state, None if team is None else warmed_up(team, begun)
    state = env.init(seeds)
    if arrival is not None:
        _traffic(env)
        state = with_arrival(state, arrival)
    return state, None if team is None else team.start(len(seeds))


def warmed_up(team: Team, begun: HumanStart) -> Memory:
    """What a team remembers after a warm-up in which it spoke and heard, but other hands drove."""
    hidden = team.start(len(begun.length)).hidden
    for step, (state, _) in enumerate(begun.warmup):
        waiting = np.flatnonzero(begun.active(step))  # the others have begun already
        part = take(state, waiting)
        talk, spoken = team.speak(part, Memory(hidden[waiting], None))
        hidden[waiting] = team.act(part, spoken, talk)[1].hidden
    return Memory(hidden, None)


def _traffic(env: Environment[Any]) -> TrafficJunction:
    if not isinstance(env, TrafficJunction):
        raise ValueError(f"{env.name} has no traffic: start must be init and arrival unset")  # noqa: TRY004
    return env


def _talk(players: Team | Scripted, state: Any, memory: Memory | None) -> tuple[Talk | None, Memory | None]:
    if not isinstance(players, Team):
        return None, None
    assert memory is not None
    return players.speak(state, memory)


def _decide(
    env: Environment[Any], players: Team | Scripted, state: Any, memory: Memory | None, talk: Talk | None
) -> tuple[Ints, Memory | None]:
    if not isinstance(players, Team):
        return players.actions(env, state), None
    assert memory is not None
    assert talk is not None
    return players.act(state, memory, talk)


class _Record:
    """Collects the steps of a rollout."""

    def __init__(self, env: Environment[Any]) -> None:
        self._env = env
        self._rows: list[tuple[NDArray[Any], ...]] = []
        self._ways: list[tuple[Ints, Ints]] = []
        self._marks: list[tuple[Bools, Bools]] = []
        self._steps: Ints | None = None

    def add(
        self, state: Any, talk: Talk | None, actions: Ints, reward: NDArray[np.float32], after: Any
    ) -> None:
        env = self._env
        alive = env.alive(state) & ~env.done(state)[:, None]
        silent = np.full(alive.shape, SILENT, np.int32)
        tokens = silent if talk is None else np.where(alive, talk.tokens, silent)
        gates = np.zeros_like(alive) if talk is None else talk.gates & alive
        if not self._marks:
            self._marks.append(self._mark(state))
            self._steps = np.zeros(len(alive), np.int32)
        assert self._steps is not None
        self._steps = self._steps + ~env.done(state)
        cells = np.where(alive, env.cell_of(state), np.int32(-1))
        self._rows.append((cells, alive, tokens, gates, actions.astype(np.int32), reward))
        self._ways.append(self._way(state, alive))
        self._marks.append(self._mark(after))

    def _way(self, state: Any, alive: Bools) -> tuple[Ints, Ints]:
        nowhere = np.full(alive.shape, -1, np.int32)
        if not isinstance(self._env, TrafficJunction):
            return nowhere, nowhere
        return np.where(alive, state.route, nowhere), np.where(alive, state.position, nowhere)

    def _mark(self, state: Any) -> tuple[Bools, Bools]:
        if isinstance(self._env, TrafficJunction):
            return self._env.collided(state), self._env.completed(state)
        nothing = np.zeros_like(self._env.alive(state))
        return nothing, nothing

    def rollout(self, state: Any) -> Rollout:
        assert self._steps is not None
        cells, alive, tokens, gates, actions, rewards = (
            np.stack(column) for column in zip(*self._rows, strict=True)
        )
        collided, completed = (np.stack(column) for column in zip(*self._marks, strict=True))
        routes, positions = (np.stack(column) for column in zip(*self._ways, strict=True))
        return Rollout(
            cells, alive, tokens, gates, actions, rewards, collided, completed,
            self._env.success(state), self._steps.astype(np.int32), alive[0].sum(1).astype(np.int32),
            routes, positions,
        )  # fmt: skip


__all__ = ["Rollout", "Scripted", "Trials", "begin", "episodes", "trials", "warmed_up"]
