"""A policy that keeps to itself what says nothing: its gate is closed wherever its token is null.

The speaker's memory and everything it decides stay as they are; listeners hear less.

Source: the paper, on removing null messages.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from models.policies.api import Policy, RandomDraws, Speech


class WithoutNulls:
    """A policy whose null messages are not sent; see `models.policies.api.Policy`."""

    def __init__(self, policy: Policy, null: NDArray[np.bool_]) -> None:
        if null.shape != (policy.tokens,):
            raise ValueError(f"{policy.tokens} tokens, but null flags for {len(null)}")
        self._policy = policy
        self._null = null
        self.channel = policy.channel
        self.tokens = policy.tokens
        self.message_size = policy.message_size
        self.hidden_size = policy.hidden_size

    def speak(
        self,
        hidden: NDArray[np.float32],
        observation: NDArray[np.float32],
        sampled: RandomDraws | None = None,
    ) -> Speech:
        said = self._policy.speak(hidden, observation, sampled)
        return said._replace(gate=said.gate & ~self._null[said.token])

    def act(
        self, hidden: NDArray[np.float32], inbox: NDArray[np.float32], sampled: RandomDraws | None = None
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        return self._policy.act(hidden, inbox, sampled)

    def vector(self, tokens: NDArray[np.int32]) -> NDArray[np.float32]:
        return self._policy.vector(tokens)
