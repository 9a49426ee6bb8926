"""A trial is a value: its spec and, folded over its events, the state of its world.

`start` and `apply` are pure. A live step goes `moved` (the world steps) then `spoken` (what is said in the
new state); `apply` does the same from a stored decision and refuses one that cannot have happened. The world
has a batch axis of 1.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.envs import registry
from models.envs.api import Environment
from models.envs.parent_child import CHILD, PARENT
from models.envs.traffic_junction import TrafficJunction
from models.vocabulary import SILENT
from server.domain import events
from server.domain.errors import CorruptError
from server.domain.events import Move, Said
from server.domain.opening import opening
from server.domain.spec import TrialSpec


@dataclass(frozen=True, slots=True)
class Trial:
    """Where a trial stands after some of its events."""

    spec: TrialSpec
    env: Environment[Any]
    world: Any
    said: Said
    """In the present state; silence once the trial is over."""
    cell: int
    """Own cell; where the participant's car was last, once it has left."""
    trail: tuple[int, ...]
    """Cells of the parent (Parent & Lost Child) or of the own car, the first included."""
    step: int = 0
    """World steps so far."""
    progress: int = 0
    """Driver: cells advanced; arrival counts the whole route. Otherwise 0."""
    route_id: int = -1
    """Driver: which route."""
    held: Said | None = None
    """What is repeated at every step, where the world holds the first message."""
    token: int | None = None
    """What the participant said in the child role."""
    outcome: str | None = None

    @property
    def over(self) -> bool:
        return self.outcome is not None

    @property
    def route(self) -> tuple[int, ...]:
        """Driver: the cells of the own route."""
        assert isinstance(self.env, TrafficJunction)
        return self.env.routes[self.route_id]

    def can(self, action: int) -> bool:
        """Whether the participant may choose this now."""
        return action in self.choices

    @property
    def choices(self) -> tuple[int, ...]:
        """Directions, numbers of signs, or go and brake; nothing once the trial is over."""
        if self.over:
            return ()
        if self.spec.role == "parent":
            return (0, 1, 2, 3)
        if self.spec.role == "child":
            panel = self.spec.condition.panel
            return tuple(sorted(panel.number_at_position)) if panel else ()
        return (0, 1)


def start(spec: TrialSpec) -> Trial:
    """The trial before anything is said.

    Raises:
        CorruptError: the spec is of another version of the task.
    """
    env = registry.make(spec.task)
    if env.version != spec.task_version:
        raise CorruptError(f"{spec.task} version {spec.task_version}, this hatlab plays {env.version}")
    world = opening(env, spec.start, np.array([spec.seed], np.uint64), spec.condition.arrival).state
    return begun(spec, env, world)


def begun(spec: TrialSpec, env: Environment[Any], world: Any) -> Trial:
    """The trial whose opening has been computed already."""
    cells = env.cell_of(world)[0]
    walker = spec.seat if spec.role == "driver" else PARENT
    return Trial(
        spec=spec,
        env=env,
        world=world,
        said=events.silence(env.agents),
        cell=int(cells[spec.seat]),
        trail=(int(cells[walker]),),
        route_id=int(world.route[0, spec.seat]) if spec.role == "driver" else -1,
    )


def spoken(trial: Trial, said: Said) -> Trial:
    """What is said in the present state. A parent hears the first message at every step."""
    first = trial.env.message_held and trial.spec.role == "parent" and trial.held is None
    return replace(trial, said=said, held=said if first else trial.held)


def chosen(trial: Trial, token: int) -> Trial:
    """The child's sign has been chosen: it is what is said from now on."""
    tokens, gates = list(trial.said.tokens), list(trial.said.gates)
    tokens[CHILD], gates[CHILD] = token, True
    said = Said(tuple(tokens), tuple(gates))
    return replace(trial, token=token, said=said, held=said)


def moved(trial: Trial, actions: tuple[int, ...]) -> Trial:
    """The world steps; nothing is said in the new state yet."""
    world, _ = trial.env.step(trial.world, np.array([actions], np.int32))
    stepped = replace(trial, world=world, said=events.silence(trial.env.agents), step=trial.step + 1)
    return driven(stepped) if trial.spec.role == "driver" else walked(stepped)


def walked(trial: Trial) -> Trial:
    cells = trial.env.cell_of(trial.world)[0].tolist()
    outcome = None
    if trial.env.success(trial.world)[0]:
        outcome = "found"
    elif trial.step >= trial.spec.condition.step_limit:
        outcome = "not_found"
    return replace(trial, cell=cells[trial.spec.seat], trail=(*trial.trail, cells[PARENT]), outcome=outcome)


def driven(trial: Trial) -> Trial:
    env, world, seat = trial.env, trial.world, trial.spec.seat
    assert isinstance(env, TrafficJunction)
    if env.completed(world)[0, seat]:
        return replace(trial, progress=int(env.route_length[trial.route_id]), outcome="arrived")
    progress = int(world.position[0, seat])
    cell = env.routes[trial.route_id][progress]
    outcome = None
    if world.collided_ever[0, seat]:  # the first collision ends the trial
        outcome = "collision"
    elif trial.step >= trial.spec.condition.step_limit:
        outcome = "limit"
    return replace(
        trial,
        cell=cell,
        trail=(*trial.trail, cell),
        progress=progress,
        outcome=outcome,
    )


def apply(trial: Trial, decision: Mapping[str, Any]) -> Trial:
    """The trial after a stored decision.

    Raises:
        CorruptError: it cannot have happened; says what contradicts what.
    """
    if trial.over:
        raise CorruptError("a decision after the end of the trial")
    action, token = decision["action"], decision["token"]
    check_action(trial, action, token)
    if trial.spec.role == "child":
        trial = chosen(trial, token)
    moves = events.moves_in(decision)
    for number, move in enumerate(moves):
        if trial.over or (number and trial.spec.role != "child"):
            raise CorruptError(f"moves.{number}: the world had stopped")
        check_move(trial, move, action, number)
        trial = heard_after(moved(trial, move.actions), move.said, number)
    if not moves or (trial.spec.role == "child" and not trial.over):
        raise CorruptError("moves: world steps are missing")
    return trial


def check_action(trial: Trial, action: object, token: object) -> None:
    if type(action) is not int or not trial.can(action):
        raise CorruptError(f"action {action!r} was not on offer")
    panel = trial.spec.condition.panel
    expected = panel.token_of(action) if panel and trial.spec.role == "child" else None
    if token != expected:
        raise CorruptError(f"token stored {token!r}, replay {expected!r}")


def check_move(trial: Trial, move: Move, action: int, number: int) -> None:
    seats = range(trial.env.agents)
    if len(move.actions) != len(seats) or not all(
        type(a) is int and 0 <= a < trial.env.actions for a in move.actions
    ):
        raise CorruptError(f"moves.{number}.actions: not one legal action for each seat")
    if trial.spec.role != "child" and move.actions[trial.spec.seat] != action:
        raise CorruptError(
            f"moves.{number}.actions: the participant's is {move.actions[trial.spec.seat]}, "
            f"the decision was {action}"
        )
    alive = trial.env.alive(trial.world)[0].tolist()
    for seat in seats:
        if not alive[seat] and move.actions[seat] != 0:
            raise CorruptError(f"moves.{number}.actions: the empty seat {seat} acts")


def heard_after(trial: Trial, said: Said, number: int) -> Trial:
    if error := speech_error(trial, said):
        raise CorruptError(f"moves.{number}.{error}")
    return spoken(trial, said)


def speech_error(trial: Trial, said: Said) -> str | None:
    """What cannot have been said in this state."""
    agents = trial.env.agents
    if len(said.tokens) != agents or len(said.gates) != agents:
        return "tokens: not one for each seat"
    if trial.over:
        return None if said == events.silence(agents) else "tokens: speech after the end of the trial"
    if trial.held is not None and said != trial.held:
        return "tokens: not the message that is held"
    return seat_error(trial, said)


def seat_error(trial: Trial, said: Said) -> str | None:
    may = (trial.env.alive(trial.world)[0] & trial.env.speaks).tolist()
    for seat, (token, gate) in enumerate(zip(said.tokens, said.gates, strict=True)):
        if type(token) is not int or type(gate) is not bool or token < SILENT:
            return f"tokens: seat {seat} holds {token!r}, {gate!r}"
        if (token != SILENT or gate) and not may[seat]:
            return f"tokens: seat {seat} is empty or mute, but speaks"
        if gate and token == SILENT:
            return f"gates: seat {seat} sent nothing"
    return None
