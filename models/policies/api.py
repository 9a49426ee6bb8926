"""What a policy is to the rest of the house: numpy in, numpy out, nothing about torch.

Shapes by legend: R rows (the living agents of a batch, flattened), O observation, H memory, D message, A
actions. A step is two calls, because what is heard lies between them: ``speak`` before the messages travel,
``act`` after.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray


class RandomDraws(Protocol):
    """A source of numbers for sampled (not greedy) behaviour; a seeded generator or counter-based draws."""

    def uniform(self, rows: int) -> NDArray[np.float64]:
        """Next ``rows`` numbers, uniform in [0, 1)."""
        ...


class GeneratorDraws:
    """Draws from a seeded numpy generator: reproducible as long as the calls come in the same order."""

    def __init__(self, seed: int) -> None:
        self._generator = np.random.default_rng(seed)

    def uniform(self, rows: int) -> NDArray[np.float64]:
        return self._generator.random(rows)


class Speech(NamedTuple):
    """What R agents say, and their memory afterwards."""

    token: NDArray[np.int32]
    """(R,) index of the message in the codebook; SILENT if the channel has no codebook."""
    gate: NDArray[np.bool_]
    """(R,) whether the message is sent at all."""
    message: NDArray[np.float32]
    """(R, D) the vector that listeners receive if the gate is open."""
    hidden: NDArray[np.float32]
    """(R, H) memory to be handed to ``act``."""


class Policy(Protocol):
    """One set of weights for every seat. Greedy unless draws are given; ties go to the lowest index."""

    @property
    def channel(self) -> str:
        """``none``, ``continuous``, ``prototype`` or ``one-hot``."""
        ...

    @property
    def tokens(self) -> int:
        """Size of the codebook K; 0 where messages are not discrete."""
        ...

    @property
    def message_size(self) -> int:
        """Floats in a message, D."""
        ...

    @property
    def hidden_size(self) -> int:
        """Floats of memory per agent, H: all recurrent states concatenated. A newcomer's memory is zeros."""
        ...

    def speak(
        self,
        hidden: NDArray[np.float32],
        observation: NDArray[np.float32],
        sampled: RandomDraws | None = None,
    ) -> Speech:
        """From memory (R, H) and observation (R, O) to what is said."""
        ...

    def act(
        self, hidden: NDArray[np.float32], inbox: NDArray[np.float32], sampled: RandomDraws | None = None
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """From the memory that ``speak`` returned and the inbox (R, D) to actions (R,) and memory (R, H)."""
        ...

    def vector(self, tokens: NDArray[np.int32]) -> NDArray[np.float32]:
        """Message vectors (R, D) of tokens (R,); zeros for SILENT."""
        ...
