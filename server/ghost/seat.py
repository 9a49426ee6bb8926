"""Who sits in the seats: a trained team, the participant's own seat included, or a script in practice.

The team runs the policy in the human's seat too, on the human's own observation: there it speaks, so that the
other agents keep hearing what they were trained to hear, and the action that it would take is replaced by the
human's. Minds go in and come out; nothing is kept here.
"""

from typing import Any, NamedTuple, Protocol

import numpy as np

from models import rng
from models.envs.api import Environment
from models.policies.api import Policy
from models.policies.scripted import Scripted
from models.policies.team import Memory, Team
from models.vocabulary import SILENT
from server.domain.events import Said, silence
from server.domain.opening import Opening

BLANK_SIGN = 33
"""Stream of a practice world's seed: index 0 the blank sign that the scripted child points at."""


class Minds(NamedTuple):
    """What the holders of the seats carry from step to step; None for scripts."""

    memory: Memory | None


class Crew(Protocol):
    """Fills every seat of one world (batch 1)."""

    signs: int
    """From how many blank signs a scripted child chooses; 0 for all others."""

    def begin(self, opening: Opening) -> Minds:
        """The minds as they come to the first state of the trial."""
        ...

    def speak(self, world: Any, minds: Minds) -> tuple[Said, Minds]:
        """What every seat says in this state."""
        ...

    def act(self, world: Any, minds: Minds, said: Said) -> tuple[list[int], Minds]:
        """What every seat would do, having heard `said`; 0 in empty seats."""
        ...


class TrainedCrew:
    """A released policy in every seat."""

    signs = 0

    def __init__(self, env: Environment[Any], policy: Policy) -> None:
        self.team = Team(env, policy)

    def begin(self, opening: Opening) -> Minds:
        """Lead the team through the warm-up with the actions that were really taken there."""
        memory = self.team.start(1)
        for state, _ in opening.warmup:
            talk, memory = self.team.speak(state, memory)
            _, memory = self.team.act(state, memory, talk)
        return Minds(memory)

    def speak(self, world: Any, minds: Minds) -> tuple[Said, Minds]:
        talk, memory = self.team.speak(world, self.known(minds))
        return Said(tuple(talk.tokens[0].tolist()), tuple(talk.gates[0].tolist())), Minds(memory)

    def act(self, world: Any, minds: Minds, said: Said) -> tuple[list[int], Minds]:
        tokens, gates = said
        # from the record, never from the talk at hand: a trial goes on the same after it was folded again
        talk = self.team.recorded(np.array([tokens], np.int32), np.array([gates], np.bool_))
        actions, memory = self.team.act(world, self.known(minds), talk)
        return actions[0].tolist(), Minds(memory)

    @staticmethod
    def known(minds: Minds) -> Memory:
        assert minds.memory is not None
        return minds.memory


class ScriptedCrew:
    """A script in every seat. It says nothing, except that a child points at some blank sign."""

    def __init__(self, env: Environment[Any], script: Scripted, signs: int) -> None:
        self.env = env
        self.script = script
        self.signs = signs

    def begin(self, opening: Opening) -> Minds:  # noqa: ARG002
        return Minds(None)

    def speak(self, world: Any, minds: Minds) -> tuple[Said, Minds]:
        quiet = silence(self.env.agents)
        if not self.signs:
            return quiet, minds
        token = rng.below(rng.word(int(world.seed[0]), BLANK_SIGN, 0, 0), self.signs)
        may = self.env.speaks.tolist()
        return Said(tuple(token if m else SILENT for m in may), tuple(may)), minds

    def act(self, world: Any, minds: Minds, said: Said) -> tuple[list[int], Minds]:  # noqa: ARG002
        wanted = self.script.actions(self.env, world)[0]
        return np.where(self.env.alive(world)[0], wanted, 0).tolist(), minds
