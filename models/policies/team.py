"""One policy in every seat of one world: the only copy of the order of a step.

    observe -> every seat speaks -> what was sent is heard -> every seat acts -> (the world moves)

Rollouts and the server both go through ``Team``; training unrolls the same order with gradients
(``models.training.unroll``) and a test holds the two together. Shapes: B batch, N seats, D message, H memory.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.envs.api import Environment
from models.policies.api import Policy, RandomDraws
from models.vocabulary import SILENT


class Talk(NamedTuple):
    """Everything said at one step."""

    tokens: NDArray[np.int32]
    """(B, N), SILENT where nobody sits, where the seat does not speak, or where the channel has no
    codebook.
    """
    gates: NDArray[np.bool_]
    """(B, N), False wherever nothing is sent."""
    messages: NDArray[np.float32]
    """(B, N, D)"""


class Memory(NamedTuple):
    """What a team carries from step to step."""

    hidden: NDArray[np.float32]
    """(B, N, H)"""
    held: Talk | None
    """The first talk of the episode where the world repeats it at every step (``message_held``)."""


class Team:
    """A policy in every seat. Holds no state: memory goes in and comes out."""

    def __init__(self, env: Environment[Any], policy: Policy, sampled: RandomDraws | None = None) -> None:
        self.env = env
        self.policy = policy
        self.sampled = sampled

    def start(self, batch: int) -> Memory:
        """The memory of B teams that have seen nothing."""
        return Memory(np.zeros((batch, self.env.agents, self.policy.hidden_size), np.float32), None)

    def speak(self, state: Any, memory: Memory) -> tuple[Talk, Memory]:
        """Every living seat observes, remembers and, where it may, speaks."""
        alive = self.env.alive(state)  # (B, N)
        hidden = np.where(self.env.fresh(state)[:, :, None], np.float32(0), memory.hidden)
        talk = self._silence(len(alive))
        said = self.policy.speak(hidden[alive], self.env.observe(state)[alive], self.sampled)
        hidden[alive] = said.hidden
        talk.tokens[alive] = said.token
        talk.gates[alive] = said.gate
        talk.messages[alive] = said.message
        return memory.held or self._only_speakers(talk), Memory(hidden, memory.held)

    def inbox(self, talk: Talk) -> NDArray[np.float32]:
        """(B, N, D): mean of what each seat receives (gate open, own excluded); zeros if nothing."""
        sent = talk.messages * talk.gates[:, :, None]
        others = sent.sum(1, keepdims=True) - sent
        count = talk.gates.sum(1, keepdims=True) - talk.gates  # (B, N)
        return np.where(count[:, :, None] > 0, others / np.maximum(count, 1)[:, :, None], 0).astype(
            np.float32
        )

    def act(self, state: Any, memory: Memory, talk: Talk) -> tuple[NDArray[np.int32], Memory]:
        """Every living seat hears and decides; actions (B, N), 0 for empty seats."""
        alive = self.env.alive(state)
        action, after = self.policy.act(memory.hidden[alive], self.inbox(talk)[alive], self.sampled)
        actions = np.zeros(alive.shape, np.int32)
        actions[alive] = action
        hidden = memory.hidden.copy()
        hidden[alive] = after
        return actions, Memory(hidden, talk if self.env.message_held else None)

    def say(self, talk: Talk, seat: int, tokens: NDArray[np.int32]) -> Talk:
        """The same talk with a person's tokens (B,) in one seat, sent."""
        said = Talk(talk.tokens.copy(), talk.gates.copy(), talk.messages.copy())
        said.tokens[:, seat] = tokens
        said.gates[:, seat] = tokens != SILENT
        said.messages[:, seat] = self.policy.vector(tokens)
        return said

    def recorded(self, tokens: NDArray[np.int32], gates: NDArray[np.bool_]) -> Talk:
        """The talk that stored tokens (B, N) and gates (B, N) stand for."""
        vectors = self.policy.vector(tokens.reshape(-1)).reshape(*tokens.shape, -1)
        return Talk(tokens.astype(np.int32), gates.astype(np.bool_), vectors)

    def _silence(self, batch: int) -> Talk:
        shape = (batch, self.env.agents)
        messages = np.zeros((*shape, self.policy.message_size), np.float32)
        return Talk(np.full(shape, SILENT, np.int32), np.zeros(shape, np.bool_), messages)

    def _only_speakers(self, talk: Talk) -> Talk:
        mute = ~self.env.speaks
        talk.tokens[:, mute] = SILENT
        talk.gates[:, mute] = False
        talk.messages[:, mute] = 0
        return talk
