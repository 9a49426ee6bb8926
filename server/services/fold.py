"""A trial being played: its world folded from the log, and beside it the minds of those who fill the seats.

The world's fold is exact anywhere. The minds are rerun over the recorded messages and actions, so that a
trial goes on the same whether it was kept in memory or read from the log.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.envs import registry
from models.policies import scripted
from models.policies.lexicon import Lexicon
from server.domain import events, trial
from server.domain.events import Move, Said
from server.domain.opening import opening
from server.domain.spec import TrialSpec
from server.domain.trial import Trial
from server.domain.view import Heard
from server.ghost.seat import Crew, Minds, ScriptedCrew, TrainedCrew
from server.ghost.translation import translate
from server.services.lab import Lab


@dataclass(frozen=True, slots=True)
class Running:
    trial: Trial
    crew: Crew
    minds: Minds
    lexicon: Lexicon | None

    @property
    def heard(self) -> Heard:
        return translate(self.trial, self.lexicon)


def begin(lab: Lab, spec: TrialSpec) -> tuple[Running, Said]:
    """The first state of a trial, and what the seats say in it.

    Raises:
        NotReadyError: the trial's agent is not loaded.
    """
    env = registry.make(spec.task)
    crew, lexicon = crew_of(lab, spec)
    world, said, minds = situation(lab, spec, crew)
    if spec.role == "child":
        said = events.silence(env.agents)  # the participant has not chosen yet
    return Running(trial.begun(spec, env, world), crew, minds, lexicon), said


def situation(lab: Lab, spec: TrialSpec, crew: Crew) -> tuple[Any, Said, Minds]:
    """The first state, what is said in it, and the minds after that; the same for everybody who plays it."""
    key = (spec.task, spec.start, spec.seed, spec.condition.arrival, spec.bundle, spec.scripted, crew.signs)
    known: tuple[Any, Said, Minds] | None = lab.openings.get(key)
    if known is None:
        seeds = np.array([spec.seed], np.uint64)
        begun = opening(registry.make(spec.task), spec.start, seeds, spec.condition.arrival)
        known = (begun.state, *crew.speak(begun.state, crew.begin(begun)))
        lab.openings.put(key, known)
    return known


def crew_of(lab: Lab, spec: TrialSpec) -> tuple[Crew, Lexicon | None]:
    env = registry.make(spec.task)
    if spec.bundle is not None:
        bundle = lab.agent(spec.bundle.name, spec.bundle.sha256)
        return TrainedCrew(env, bundle.policy), bundle.lexicon
    panel = spec.condition.panel
    script = scripted.make(spec.scripted or "")
    return ScriptedCrew(env, script, len(panel.positions) if panel else 0), None


def fold(lab: Lab, bodies: Sequence[Mapping[str, Any]]) -> Running:
    """The trial after these events, of which the first is its start."""
    start = bodies[0]
    running, _ = begin(lab, TrialSpec.model_validate(start["spec"]))
    running = replace(running, trial=trial.spoken(running.trial, events.said_in(start)))
    for body in bodies[1:]:
        running = follow(running, body)
    return running


def follow(running: Running, decision: Mapping[str, Any]) -> Running:
    """Go through a stored decision: the minds hear and see what was recorded."""
    running = choose(running, decision["token"])
    for move in events.moves_in(decision):
        running, _ = step(running, None, recorded=move)
    return running


def play(running: Running, action: int) -> tuple[Running, tuple[Move, ...], int | None]:
    """Take a decision of the participant, until the next one or the end.

    Returns:
        The trial after it, the world steps that it caused, and the token that it stands for (child role).
    """
    panel = running.trial.spec.condition.panel
    token = panel.token_of(action) if panel and running.trial.spec.role == "child" else None
    running = choose(running, token)
    moves = []
    while True:
        running, move = step(running, action if token is None else None)
        moves.append(move)
        if running.trial.over or token is None:
            return running, tuple(moves), token


def choose(running: Running, token: int | None) -> Running:
    return running if token is None else replace(running, trial=trial.chosen(running.trial, token))


def step(running: Running, action: int | None, recorded: Move | None = None) -> tuple[Running, Move]:
    """One world step: every seat acts, the participant's by `action`; then every seat speaks.

    Where it is `recorded`, the world and the minds go on from the record.

    Returns:
        The trial after the step, and the step as the seats have it now.
    """
    wanted, minds = running.crew.act(running.trial.world, running.minds, running.trial.said)
    if action is not None:
        wanted[running.trial.spec.seat] = action
    actions = tuple(wanted)
    stepped = trial.moved(running.trial, recorded.actions if recorded else actions)
    said = events.silence(stepped.env.agents)  # nobody speaks any more once the trial is over
    if not stepped.over:
        said, minds = running.crew.speak(stepped.world, minds)
        said = stepped.held or said
    stepped = trial.spoken(stepped, recorded.said if recorded else said)
    return replace(running, trial=stepped, minds=minds), Move(actions, said)
