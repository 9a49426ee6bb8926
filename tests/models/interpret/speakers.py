"""Policies whose language is known: one says exactly where it is, one says nothing that means anything."""

import numpy as np
from numpy.typing import NDArray

from models.envs.traffic_junction import TrafficJunction
from models.policies.api import RandomDraws, Speech


class Honest:
    """Says the number of the road cell on which it stands; drives on, or as told."""

    channel = "prototype"
    message_size = 2
    hidden_size = 1

    def __init__(self, env: TrafficJunction, gate_open: bool = True) -> None:
        self.road = env.roads.road_cells
        self.tokens = len(self.road)
        self._places = np.stack([self.road // env.shape[1], self.road % env.shape[1]], 1).astype(np.float32)
        self._open = gate_open

    def say(self, observation: NDArray[np.float32]) -> NDArray[np.int32]:
        return observation[:, 2:-1].argmax(axis=1).astype(np.int32)

    def speak(
        self,
        hidden: NDArray[np.float32],
        observation: NDArray[np.float32],
        sampled: RandomDraws | None = None,
    ) -> Speech:
        token = self.say(observation)
        return Speech(token, np.full(len(token), self._open), self.vector(token), hidden)

    def act(
        self, hidden: NDArray[np.float32], inbox: NDArray[np.float32], sampled: RandomDraws | None = None
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        return np.zeros(len(hidden), np.int32), hidden

    def vector(self, tokens: NDArray[np.int32]) -> NDArray[np.float32]:
        vectors = self._places[np.maximum(tokens, 0)]
        return np.where(np.asarray(tokens)[:, None] >= 0, vectors, np.float32(0))


class Babbler(Honest):
    """Says token 0 or 1, whatever it sees."""

    def say(self, observation: NDArray[np.float32]) -> NDArray[np.int32]:
        return (np.arange(len(observation)) % 2).astype(np.int32)
