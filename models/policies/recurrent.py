"""The recurrent communicating policy: encoder, first LSTM, message and gate, second LSTM, heads.

    observation -> encoder -> LSTM 1 -> message; gate, with LSTM 2's last state      (``speak``)
    inbox, LSTM 1 -> LSTM 2 -> action, value                                         (``act``)

The message is made from [hidden 1, encoded observation]. The gate reads hidden 2 of the last step as well,
which knows what was heard: "somebody new, who needs to hear of me" (docs/adr/0017). The heads read [hidden 2,
inbox, encoded observation] and the product of two linear maps of inbox and encoded observation: "is my next
cell among theirs" is a match, which no linear head can see. Shapes: R rows (living agents), O observation, H
hidden, D message, K tokens, A actions.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from models.policies.api import RandomDraws, Speech
from models.policies.channels import OneHotChannel, PrototypeChannel, gate_of, make_channel, pick
from models.policies.shapes import require

MEMORY_PARTS = 5  # hidden 1, cell 1, hidden 2, cell 2, and the encoded observation kept between speak and act


@dataclass(frozen=True, slots=True)
class Architecture:
    """Every size that the weights depend on; part of a bundle's manifest."""

    observation_size: int
    """Floats per observation, O."""
    actions: int
    """Number of actions, A."""
    hidden: int
    """Width of encoder and LSTMs, H."""
    message: int
    """Floats per message, D."""
    tokens: int
    """Codebook size K; 0 for a channel without codebook."""
    channel: str
    """none, continuous, prototype or one-hot."""
    gate: str
    """open (every message is sent) or learned."""

    def __post_init__(self) -> None:
        if self.gate not in ("open", "learned"):
            raise ValueError(f"gate is {self.gate!r}; choose open or learned")
        if min(self.observation_size, self.actions, self.hidden, self.message) < 1:
            raise ValueError("observation_size, actions, hidden and message must be at least 1")

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


class Memory(NamedTuple):
    """States of the two LSTMs, each (R, H); zeros for a newcomer."""

    hidden1: Tensor
    cell1: Tensor
    hidden2: Tensor
    cell2: Tensor


class Said(NamedTuple):
    """What ``RecurrentNet.speak`` makes of R rows, with gradients."""

    token: Tensor
    """(R,) int64, -1 where the channel has no codebook."""
    message: Tensor
    """(R, D)"""
    gate: Tensor
    """(R,) 0.0 or 1.0"""
    gate_logit: Tensor
    """(R,)"""
    memory: Memory
    """after the first LSTM"""
    encoded: Tensor
    """(R, H) encoded observation, which ``act`` reads too"""
    raw: Tensor
    """(R, D) before the channel"""
    loss: Tensor
    """(R,) upkeep of the codebook"""


class Done(NamedTuple):
    """What ``RecurrentNet.act`` makes of R rows: action logits (R, A), memory, features (R, F)."""

    logits: Tensor
    memory: Memory
    features: Tensor


class Encoder(nn.Module):
    """Observation (R, O) to (R, H): rectified and periodic features, then one layer.

    Observations mix one-hot places with fine scales (route 3 of 12 is 0.27): the periodic features begin with
    large weights, so that neighbouring values of a scale lie far apart from the first update on.
    """

    FREQUENCY = (
        6.0  # standard deviation of the first weights: a twelfth of a scale turns the phase by half a radian
    )

    def __init__(self, observation: int, hidden: int) -> None:
        super().__init__()
        self.plain = nn.Linear(observation, hidden)
        self.wave = nn.Linear(observation, hidden)
        nn.init.normal_(self.wave.weight, std=self.FREQUENCY)
        self.join = nn.Linear(2 * hidden, hidden)

    def forward(self, observation: Tensor) -> Tensor:
        features = torch.cat((self.plain(observation).relu(), self.wave(observation).sin()), 1)
        return self.join(features).tanh()  # type: ignore[no-any-return]


class RecurrentNet(nn.Module):
    """The weights. Heads that only training needs (value, decoder) are added by the trainer."""

    def __init__(self, architecture: Architecture) -> None:
        super().__init__()
        a, hidden = architecture, architecture.hidden
        self.architecture = architecture
        self.encoder = Encoder(a.observation_size, hidden)
        self.first = nn.LSTMCell(hidden, hidden)
        self.speech = nn.Sequential(nn.Linear(2 * hidden, hidden), nn.ReLU(), nn.Linear(hidden, a.message))
        self.gate = (
            nn.Sequential(nn.Linear(3 * hidden, hidden), nn.ReLU(), nn.Linear(hidden, 1))
            if a.gate == "learned"
            else None
        )
        self.channel = make_channel(a.channel, a.tokens, a.message)
        self.second = nn.LSTMCell(hidden + a.message, hidden)
        self.match_inbox = nn.Linear(a.message, hidden)
        self.match_own = nn.Linear(hidden, hidden)
        self.head = nn.Sequential(nn.Linear(self.features, hidden), nn.ReLU(), nn.Linear(hidden, a.actions))
        for layer in (self.encoder.plain, self.encoder.join, *self.speech):
            if isinstance(layer, nn.Linear):  # the default lets messages start near zero
                nn.init.orthogonal_(layer.weight, gain=2.0**0.5)

    @property
    def features(self) -> int:
        """Floats that the heads read: hidden 2, inbox, encoded observation, match."""
        return 3 * self.architecture.hidden + self.architecture.message

    def speak(
        self, memory: Memory, observation: Tensor, draws: Tensor | None = None, *, discrete: bool = True
    ) -> Said:
        """From memory and observation (R, O) to message and gate.

        Args:
            memory: what ``act`` returned at the last step; zeros for a newcomer.
            observation: (R, O).
            draws: uniform numbers (R, 2), first for the token, second for the gate; greedy without.
            discrete: False sends the raw vector instead of its prototype (training before quantisation).
        """
        encoded = self.encoder(observation)
        hidden1, cell1 = self.first(encoded, (memory.hidden1, memory.cell1))
        raw = self.speech(torch.cat((hidden1, encoded), 1))
        after = memory._replace(hidden1=hidden1, cell1=cell1)
        return self.utter(raw, after, encoded, draws, discrete=discrete)

    def utter(
        self,
        raw: Tensor,
        memory: Memory,
        encoded: Tensor,
        draws: Tensor | None = None,
        *,
        discrete: bool = True,
    ) -> Said:
        """The second half of ``speak``: what the speech layer's vectors (R, D) become, and if it is sent."""
        if self.architecture.channel != "one-hot":
            raw = torch.tanh(raw)
        token, message, loss = self._utter(raw, draws, discrete)
        logit = self._gate_logit(memory, encoded)
        gate = (
            torch.ones_like(logit)
            if self.gate is None
            else gate_of(logit, None if draws is None else draws[:, 1])
        )
        if self.architecture.channel == "none":
            gate = torch.zeros_like(logit)
        return Said(token, message, gate, logit, memory, encoded, raw, loss)

    def _utter(self, raw: Tensor, draws: Tensor | None, discrete: bool) -> tuple[Tensor, Tensor, Tensor]:
        if isinstance(self.channel, OneHotChannel):
            return self.channel(raw, None if draws is None else draws[:, 0])  # type: ignore[no-any-return]
        token, message, loss = self.channel(raw)
        return token, message if discrete or self.architecture.channel == "none" else raw, loss

    def _gate_logit(self, memory: Memory, encoded: Tensor) -> Tensor:
        if self.gate is None:
            return encoded.new_full((encoded.shape[0],), 20.0)  # open with probability 1 - 2e-9
        source = torch.cat((memory.hidden1, encoded, memory.hidden2), 1)
        return self.gate(source).squeeze(1)  # type: ignore[no-any-return]

    def act(self, memory: Memory, encoded: Tensor, inbox: Tensor) -> Done:
        """From what ``speak`` returned and the inbox (R, D) to action logits."""
        heard = torch.cat((memory.hidden1, inbox), 1)
        hidden2, cell2 = self.second(heard, (memory.hidden2, memory.cell2))
        match = self.match_inbox(inbox) * self.match_own(encoded)
        features = torch.cat((hidden2, inbox, encoded, match), 1)
        return Done(self.head(features), memory._replace(hidden2=hidden2, cell2=cell2), features)


class RecurrentPolicy:
    """The weights as a ``Policy``: numpy in, numpy out, no gradients."""

    def __init__(self, net: RecurrentNet, discrete: bool = True, open_gate: bool = False) -> None:
        """Wrap the weights.

        Args:
            net: the weights, used as they are now and whenever they change.
            discrete: False sends raw vectors, as training does before quantisation.
            open_gate: every message is sent, as training does before the gate is taught.
        """
        self.net = net.eval()
        self._discrete = discrete or net.architecture.channel != "prototype"
        self._open_gate = open_gate and net.architecture.channel != "none"
        self.architecture = net.architecture
        self.channel = net.architecture.channel
        self.tokens = net.architecture.tokens
        self.message_size = net.architecture.message
        self.hidden_size = MEMORY_PARTS * net.architecture.hidden
        self._vectors = _vectors(net)

    @classmethod
    def from_weights(cls, architecture: Architecture, weights: Mapping[str, Tensor]) -> "RecurrentPolicy":
        """Build the policy around stored weights.

        Raises:
            ValueError: a weight is missing, unknown or of another shape.
        """
        net = RecurrentNet(architecture)
        require({name: tensor.shape for name, tensor in net.state_dict().items()}, weights)
        net.load_state_dict(dict(weights))
        return cls(net)

    def weights(self) -> dict[str, Tensor]:
        """What a bundle stores: name to tensor, contiguous float32."""
        return {name: tensor.detach().contiguous() for name, tensor in self.net.state_dict().items()}

    def speak(
        self,
        hidden: NDArray[np.float32],
        observation: NDArray[np.float32],
        sampled: RandomDraws | None = None,
    ) -> Speech:
        draws = None
        if sampled is not None:
            draws = torch.from_numpy(np.stack([sampled.uniform(len(hidden)) for _ in range(2)], 1))
        with torch.inference_mode():
            memory, _ = self._split(hidden)
            said = self.net.speak(memory, torch.from_numpy(observation), draws, discrete=self._discrete)
            after = torch.cat((*said.memory, said.encoded), 1)
        token = said.token.numpy().astype(np.int32)
        gate = (said.gate.numpy() >= 0.5) | self._open_gate
        exact = self._discrete and self.tokens > 0  # a straight-through sum is off by a rounding error
        message = self.vector(token) if exact else said.message.numpy()
        return Speech(token, gate, message, after.numpy())

    def act(
        self, hidden: NDArray[np.float32], inbox: NDArray[np.float32], sampled: RandomDraws | None = None
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        with torch.inference_mode():
            memory, encoded = self._split(hidden)
            done = self.net.act(memory, encoded, torch.from_numpy(inbox))
            after = torch.cat((*done.memory, encoded), 1)
            if sampled is None:
                action = done.logits.argmax(1)
            else:
                action = pick(done.logits.softmax(1), torch.from_numpy(sampled.uniform(len(hidden))))
        return action.numpy().astype(np.int32), after.numpy()

    def _split(self, hidden: NDArray[np.float32]) -> tuple[Memory, Tensor]:
        """LSTM states, and the encoded observation kept between ``speak`` and ``act``."""
        *states, encoded = torch.from_numpy(hidden).split(self.architecture.hidden, dim=1)  # type: ignore[no-untyped-call]
        return Memory(*states), encoded

    def vector(self, tokens: NDArray[np.int32]) -> NDArray[np.float32]:
        return self._vectors[tokens]

    @property
    def codebook(self) -> NDArray[np.float32]:
        """Message vectors of all tokens, (K, D)."""
        return self._vectors[:-1]


def _vectors(net: RecurrentNet) -> NDArray[np.float32]:
    """(K + 1, D): vectors of the tokens, then zeros, which is where SILENT (-1) points."""
    architecture = net.architecture
    table = np.zeros((architecture.tokens + 1, architecture.message), dtype=np.float32)
    if isinstance(net.channel, PrototypeChannel):
        table[:-1] = net.channel.codebook.detach().numpy()
    elif architecture.channel == "one-hot":
        table[:-1] = np.eye(architecture.tokens, dtype=np.float32)
    return table
