"""Episodes with gradients: the same order of a step as ``models.policies.team``, on torch tensors.

Only living agents go through the network: at each step the living seats of all episodes are one block of
rows, and the memory of the next block is gathered from the last one. Shapes: T steps, B episodes, N seats, M
rows of all steps together, D message, A actions, F features.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.envs.api import Environment
from models.envs.starts import HumanStart
from models.policies.recurrent import Done, Memory, RecurrentNet, Said
from models.training.arithmetic import FORGOTTEN, Arithmetic, Recall, Seen, Spoken, distinct

Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Manner:
    """How the agents behave while they learn."""

    discrete: bool = True
    """Prototypes (or raw vectors) are sent."""
    sampled: bool = True
    """Actions, tokens and gates are drawn (or greedy)."""
    explore: float = 0.0
    """Probability of an action drawn uniformly."""
    open_gate: bool = False
    """Every message is sent, whatever the gate says."""


class Beginning(NamedTuple):
    """Where episodes begin: the states, and what all B*N seats remember, or None for nothing."""

    state: Any
    memory: Memory | None


class Unrolled(NamedTuple):
    """All rows (M) in order of step, then episode, then seat; and what the world gave at every (T, B, N)."""

    step: NDArray[np.int64]
    """(M,)"""
    place: NDArray[np.int64]
    """(M,) episode * N + seat"""
    logits: Tensor
    """(M, A)"""
    action: Tensor
    """(M,) int64"""
    features: Tensor
    """(M, F)"""
    hidden: Tensor
    """(M, H) second LSTM"""
    inbox: Tensor
    """(M, D)"""
    raw: Tensor
    """(M, D)"""
    token: Tensor
    """(M,) int64"""
    gate: Tensor
    """(M,)"""
    gate_logit: Tensor
    """(M,)"""
    channel_loss: Tensor
    """scalar: mean over the rows that were uttered"""
    uttered: Bools
    """(M,) the message of this row can be heard: its seat speaks and, where messages are held, it is the
    first.
    """
    living: Bools
    """(T, B, N)"""
    continues: Bools
    """(T, B, N) the same occupant lives on in the next state."""
    rewards: NDArray[np.float32]
    """(T, B, N)"""
    states: tuple[Any, ...]
    """T + 1 states"""
    memory: Memory
    """of all B*N seats after the last step, without gradient"""


class Mind:
    """One policy in B * N seats, with its memory kept as the rows of the last step."""

    def __init__(self, env: Environment[Any], net: RecurrentNet, batch: int, manner: Manner) -> None:
        self.env, self.net, self.batch, self.manner = env, net, batch, manner
        self._arithmetic = Arithmetic(net)
        self._rows = blank(net, 1)
        self._row_of = np.zeros(batch * env.agents, np.int64)
        self.device = device_of(net)
        self._speaks = self._place(np.tile(env.speaks, batch).astype(np.float32))
        self._held: tuple[Tensor, Tensor] | None = None

    def remember(self, memory: Memory) -> None:
        """Start from the memories of all B*N seats instead of zeros."""
        self._rows, self._row_of = memory, np.arange(len(memory.hidden1))

    def memories(self) -> Memory:
        """What all B*N seats remember."""
        return self._recall(self._row_of)

    def _place(self, array: NDArray[Any]) -> Tensor:
        """The array where the network is."""
        return torch.from_numpy(array).to(self.device)

    def _recall(self, row: NDArray[np.int64]) -> Memory:
        """The rows of the last step; zeros for -1."""
        wanted = np.flatnonzero(row >= 0)
        successor = np.full(len(self._rows.hidden1), FORGOTTEN)
        successor[row[wanted]] = wanted
        index = [
            np.maximum(row, 0),
            np.flatnonzero(row < 0),
            np.maximum(successor, 0),
            np.flatnonzero(successor < 0),
        ]
        return Memory(*Recall.apply(*(self._place(each) for each in index), *self._rows))  # type: ignore[no-untyped-call]

    def speak(
        self, state: Any, living: Bools, generator: torch.Generator | None
    ) -> tuple[NDArray[np.int64], Spoken]:
        """The living seats (B, N) speak; returns their places (R,) and what they said."""
        place = np.flatnonzero(living)
        row = np.where(self.env.fresh(state).reshape(-1)[place], FORGOTTEN, self._row_of[place])
        observation = self.env.observe(state).reshape(-1, self.env.observation_size)[place]
        first, which = distinct(observation)
        draws = None if generator is None else torch.rand(len(place), 2, generator=generator).to(self.device)
        said, own = self._arithmetic.speak(
            self._recall(row),
            Seen(self._place(observation[first]), self._place(which)),
            draws,
            discrete=self.manner.discrete,
        )
        gate = torch.ones_like(said.gate) if self.manner.open_gate else said.gate
        if self.net.architecture.channel == "none":
            gate = torch.zeros_like(gate)
        return place, Spoken(said._replace(gate=gate * self._speaks[self._place(place)]), own)

    def act(self, spoken: Spoken, inbox: Tensor) -> Done:
        """They act on what they heard."""
        return self._arithmetic.act(spoken, inbox)

    def inbox(self, place: NDArray[np.int64], said: Said) -> Tensor:
        """(R, D): mean of what each living seat receives."""
        where = self._place(place)
        message, gate = said.message * said.gate.unsqueeze(1), said.gate
        if self.env.message_held:
            message, gate = self._hold(where, message, gate)
        episode = where // self.env.agents
        total = message.new_zeros(self.batch, message.shape[1]).index_add(0, episode, message)
        count = gate.new_zeros(self.batch).index_add(0, episode, gate)
        others = count.index_select(0, episode) - gate
        return (total.index_select(0, episode) - message) / others.clamp(min=1).unsqueeze(1)

    def _hold(self, where: Tensor, message: Tensor, gate: Tensor) -> tuple[Tensor, Tensor]:
        if self._held is None:
            seats = self.batch * self.env.agents
            self._held = (
                message.new_zeros(seats, message.shape[1]).index_copy(0, where, message),
                gate.new_zeros(seats).index_copy(0, where, gate),
            )
        return self._held[0].index_select(0, where), self._held[1].index_select(0, where)

    def keep(self, place: NDArray[np.int64], memory: Memory) -> None:
        """Remember the rows (R) of this step; everybody else forgets."""
        self._rows = memory if len(place) else blank(self.net, 1)
        self._row_of = np.full(self.batch * self.env.agents, FORGOTTEN)
        self._row_of[place] = np.arange(len(place))


def blank(net: RecurrentNet, rows: int) -> Memory:
    """Memories of newcomers."""
    return Memory(
        *(torch.zeros(rows, net.architecture.hidden, device=device_of(net)) for _ in Memory._fields)
    )


def device_of(net: RecurrentNet) -> torch.device:
    """Where the network is, and with it all tensors of an episode; worlds and draws are on the CPU."""
    return net.encoder.plain.weight.device


Override = Callable[[int, Any, Ints], Ints]
"""(step, state, the policy's actions (B, N)) to the actions that are taken."""


def unroll(
    env: Environment[Any],
    net: RecurrentNet,
    beginning: Beginning,
    manner: Manner,
    generator: torch.Generator,
    override: Override | None = None,
    steps: range | None = None,
) -> Unrolled:
    """Play B episodes, or a window of their steps, with gradients from every row to all messages before."""
    state = beginning.state
    batch = len(env.done(state))
    mind = Mind(env, net, batch, manner)
    if beginning.memory is not None:
        mind.remember(beginning.memory)
    rows: list[_Rows] = []
    states, rewards, living = [state], [], []
    for step in steps or range(env.steps_max):
        here = env.alive(state) & ~env.done(state)[:, None]
        actions, found = _step(mind, state, here, generator, step, override)
        rows.append(found)
        living.append(here)
        state, reward = env.step(state, actions)
        rewards.append(reward)
        states.append(state)
    memory = Memory(*(part.detach() for part in mind.memories()))
    return _collect(
        env,
        rows,
        living,
        rewards,
        states,
        memory,
        steps.start if steps else 0,
    )


class _Rows(NamedTuple):
    step: NDArray[np.int64]
    place: NDArray[np.int64]
    said: Said
    logits: Tensor
    action: Tensor
    features: Tensor
    inbox: Tensor


def _step(
    mind: Mind, state: Any, living: Bools, generator: torch.Generator, step: int, override: Override | None
) -> tuple[Ints, _Rows]:
    place, spoken = mind.speak(state, living, generator if mind.manner.sampled else None)
    said = spoken.said
    inbox = mind.inbox(place, said)
    done = mind.act(spoken, inbox)
    mind.keep(place, done.memory)
    action = _choose(done.logits, mind.manner, generator)
    actions = np.zeros(living.size, np.int32)
    actions[place] = action.cpu().numpy()
    grid = actions.reshape(living.shape)
    if override is not None:
        grid = override(step, state, grid)
        action = torch.from_numpy(grid.reshape(-1)[place].astype(np.int64)).to(mind.device)
    at = np.full(len(place), step)
    return grid, _Rows(at, place, said, done.logits, action, done.features, inbox)


def _choose(logits: Tensor, manner: Manner, generator: torch.Generator) -> Tensor:
    detached = logits.detach()
    if not manner.sampled and not manner.explore:
        return detached.argmax(1)
    if manner.sampled:
        uniform = torch.rand(detached.shape, generator=generator).clamp(min=1e-9).to(detached.device)
        chosen = (detached - (-uniform.log()).log()).argmax(1)  # Gumbel's way to draw from softmax
    else:
        chosen = detached.argmax(1)
    if manner.explore:
        stray = torch.rand(len(chosen), generator=generator) < manner.explore
        other = torch.randint(0, detached.shape[1], chosen.shape, generator=generator)
        chosen = torch.where(stray.to(chosen.device), other.to(chosen.device), chosen)
    return chosen


def _collect(
    env: Environment[Any],
    rows: list[_Rows],
    living: list[Bools],
    rewards: list[NDArray[np.float32]],
    states: list[Any],
    memory: Memory,
    first: int,
) -> Unrolled:
    features = torch.cat([r.features for r in rows])
    hidden = rows[0].said.encoded.shape[1]
    step, place = np.concatenate([r.step for r in rows]), np.concatenate([r.place for r in rows])
    uttered = env.speaks[place % env.agents] & ((step == 0) | (not env.message_held))
    losses = torch.cat([r.said.loss for r in rows])[torch.from_numpy(np.flatnonzero(uttered))]
    after = [env.alive(s) & ~env.fresh(s) & ~env.done(s)[:, None] for s in states[1:]]
    return Unrolled(
        step=step - first,
        place=place,
        logits=torch.cat([r.logits for r in rows]),
        action=torch.cat([r.action for r in rows]),
        features=features,
        hidden=features[:, :hidden],
        inbox=torch.cat([r.inbox for r in rows]),
        raw=torch.cat([r.said.raw for r in rows]),
        token=torch.cat([r.said.token for r in rows]),
        gate=torch.cat([r.said.gate for r in rows]),
        gate_logit=torch.cat([r.said.gate_logit for r in rows]),
        channel_loss=losses.sum() / max(len(losses), 1),
        uttered=uttered,
        living=np.stack(living),
        continues=np.stack([now & then for now, then in zip(living, after, strict=True)]),
        rewards=np.stack(rewards),
        states=tuple(states),
        memory=memory,
    )


@torch.no_grad()
def warmed_up(
    env: Environment[Any], net: RecurrentNet, begun: HumanStart, manner: Manner, generator: torch.Generator
) -> Memory:
    """Memories of all B*N seats after a warm-up: the policy spoke and heard, but other hands drove."""
    batch = len(begun.length)
    mind = Mind(env, net, batch, manner)
    memory = blank(net, batch * env.agents)
    for step, (state, _) in enumerate(begun.warmup):
        mind.remember(memory)
        place, spoken = mind.speak(
            state, env.alive(state) & begun.active(step)[:, None], generator if manner.sampled else None
        )
        done = mind.act(spoken, mind.inbox(place, spoken.said))
        for kept, after in zip(memory, done.memory, strict=True):
            kept[torch.from_numpy(place).to(kept.device)] = after
    return memory
