"""REINFORCE with a value baseline, on rows of living agents; and the imitation loss that warms it up.

    loss = - mean(A log pi(a)) - e mean(H(pi)) + v mean((V - R)^2) + channel upkeep
           + d information similarity + g budget loss
    A: generalised advantage of each agent while it lives, normalised over the batch; R = A + V.

A learned gate is an action too: log pi(gate) A is added where gates were drawn. Shapes: T steps, B episodes,
N seats, M rows, A actions.

Source: Williams 1992; Schulman et al. 2016 (generalised advantage estimation); Karten et al. 2023.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from models.envs.api import Environment
from models.envs.traffic_junction import TrafficJunction
from models.policies.recurrent import RecurrentNet
from models.training.config import Decoder, Phase
from models.training.enforcer import Enforcer, silence
from models.training.similarity import Reader, similarity_loss
from models.training.unroll import Unrolled

NAMES_WEIGHT = 0.1  # small beside a decoder of weight 5 (names follow places), felt beside one of weight 1
CRASH = 10.0  # what Traffic Junction charges for a shared cell, FACTS of the task

Floats = NDArray[np.float32]


class Learner(nn.Module):
    """The policy with the heads that only training needs."""

    def __init__(self, env: Environment[Any], net: RecurrentNet, decoder: Decoder) -> None:
        super().__init__()
        size = net.architecture
        self.net = net
        self.critic = nn.Sequential(
            nn.Linear(net.features, size.hidden), nn.ReLU(), nn.Linear(size.hidden, 1)
        )
        vectors = size.channel in {"continuous", "prototype"}
        self.decoder = (
            None
            if decoder.target == "none"
            else Reader(env, decoder, size.hidden, size.message, vectors=vectors)
        )


class Losses(NamedTuple):
    """The loss to be minimised and its parts for the log."""

    total: Tensor
    parts: dict[str, float]


def gradient_loss(
    env: Environment[Any],
    learner: Learner,
    seen: Unrolled,
    phase: Phase,
    entropy_weight: float,
    enforcer: Enforcer | None = None,
    labels: NDArray[np.int64] | None = None,
) -> Losses:
    """Loss of one batch.

    Args:
        env: the world it was played in.
        learner: the weights that played it.
        seen: the episodes, with gradients.
        phase: weights and what the gate is taught.
        entropy_weight: weight of the action entropy now.
        enforcer: the controller, in an enforced phase.
        labels: (M,) actions of the rule, for imitation.
    """
    parts: dict[str, Tensor] = {}
    if phase.kind == "reinforce":
        parts |= _policy_parts(env, learner, seen, phase, entropy_weight, enforcer)
    if phase.discrete:
        parts["channel"] = seen.channel_loss + upkeep_of_names(learner.net, seen)
    if labels is not None:
        weight = phase.policy_weight if phase.kind == "imitate" else phase.imitation_weight
        parts["imitation"] = weight * imitation_loss(
            seen.logits, torch.from_numpy(labels).to(seen.logits.device), phase.brake_weight
        )
    if learner.decoder is not None and phase.decoder_weight:
        parts["decoder"] = phase.decoder_weight * similarity_loss(env, learner.decoder, seen)
    if phase.gate == "budget" and phase.budget is not None:
        parts["budget"] = phase.gate_weight * budget_loss(env, seen, phase.budget)
    total = torch.stack(list(parts.values())).sum()
    return Losses(total, {name: float(part.detach()) for name, part in parts.items()})


def _policy_parts(
    env: Environment[Any],
    learner: Learner,
    seen: Unrolled,
    phase: Phase,
    entropy_weight: float,
    enforcer: Enforcer | None,
) -> dict[str, Tensor]:
    value = learner.critic(seen.features).squeeze(1)
    baseline = value.detach()
    rewards = shaped(env, seen, phase, enforcer)
    each = advantages(rewards, grid(baseline.cpu().numpy(), seen), seen.continues, phase.gamma, phase.lam)
    raw = torch.from_numpy(each.reshape(len(rewards), -1)[seen.step, seen.place]).to(value.device)  # (M,)
    advantage = (raw - raw.mean()) / (raw.std() + 1e-6)
    log = seen.logits.log_softmax(1)
    chosen = log.gather(1, seen.action.unsqueeze(1)).squeeze(1)
    entropy = -(log.exp() * log).sum(1).mean()
    parts = {
        "policy": -phase.policy_weight * (advantage * chosen).mean(),
        "entropy": -entropy_weight * entropy,
        "value": phase.value_weight * (value - baseline - raw).square().mean(),
    }
    if phase.gate != "open":
        gate = seen.gate.detach()
        log_gate = -nn.functional.binary_cross_entropy_with_logits(seen.gate_logit, gate, reduction="none")
        parts["gate"] = -phase.policy_weight * (advantage * log_gate).mean()
    return parts


def upkeep_of_names(net: RecurrentNet, seen: Unrolled) -> Tensor:
    """What keeps all names of a one-hot channel in use and each choice clear; 0 for other channels.

    log K - I(name; what the speaker knows), with I = H(mean p) - mean H(p) over the rows that can be heard.
    Source: Krause, Perona, Gomes 2010, regularized information maximization.
    """
    if net.architecture.channel != "one-hot":
        return seen.raw.new_zeros(())
    each = seen.raw[torch.from_numpy(np.flatnonzero(seen.uttered))].softmax(1)  # (M', K)
    mean = each.mean(0)
    information = _entropy(mean) - _entropy(each).mean()
    missing: Tensor = math.log(len(mean)) - information
    return NAMES_WEIGHT * missing


def _entropy(probability: Tensor) -> Tensor:
    """In nats, over the last axis."""
    return -(probability * probability.clamp(min=1e-9).log()).sum(-1)


def imitation_loss(logits: Tensor, labels: Tensor, brake_weight: float) -> Tensor:
    """Mean cross-entropy (M rows), steps at which the rule does not take action 0 (gas) weighted."""
    each = nn.functional.cross_entropy(logits, labels, reduction="none")
    weight = torch.where(labels > 0, brake_weight, 1.0)
    return (weight * each).sum() / weight.sum()


def budget_loss(env: Environment[Any], seen: Unrolled, budget: float) -> Tensor:
    """Squared distance of the mean gate from the budget, for episodes from ``init`` and human trials apart.

    Differentiable through the gates, which pass their gradient straight through.
    """
    human = _human(seen)[seen.place // env.agents]
    groups = [torch.from_numpy(np.flatnonzero(human == kind)) for kind in (False, True)]
    means = [seen.gate[rows].mean() for rows in groups if len(rows)]
    return (torch.stack(means) - budget).square().mean()


def _human(seen: Unrolled) -> NDArray[np.bool_]:
    """(B,) which episodes are human trials."""
    guest = getattr(seen.states[0], "guest", None)
    return np.zeros(seen.living.shape[1], np.bool_) if guest is None else np.asarray(guest >= 0)


def shaped(env: Environment[Any], seen: Unrolled, phase: Phase, enforcer: Enforcer | None = None) -> Floats:
    """Training rewards (T, B, N): the world's, with what the phase changes about them."""
    rewards = np.where(seen.living, seen.rewards, np.float32(0))
    if phase.first_collision_only and isinstance(env, TrafficJunction):
        pairs = zip(seen.states[:-1], seen.states[1:], strict=True)
        again = np.stack([env.collided(after) & now.collided_ever & ~after.fresh for now, after in pairs])
        rewards = rewards + np.float32(CRASH) * again
    if phase.shared:
        count = seen.living.sum(2, keepdims=True)
        mean = rewards.sum(2, keepdims=True) / np.maximum(count, 1)
        rewards = np.where(seen.living, (1 - phase.shared) * rewards + phase.shared * mean, 0)
    penalty = _penalty(seen, phase, enforcer)
    return (rewards - np.where(seen.living, penalty[None, :, None], 0)).astype(np.float32)


def _penalty(seen: Unrolled, phase: Phase, enforcer: Enforcer | None) -> NDArray[np.float64]:
    share = shares(seen)
    if phase.gate == "rewarded":
        return phase.gate_weight * silence(share)
    if enforcer is not None:
        return phase.gate_weight * enforcer.penalty(share)
    return np.zeros_like(share)


def shares(seen: Unrolled) -> NDArray[np.float64]:
    """(B,) messages sent per living agent and step in each episode."""
    seats = seen.living.shape[2]
    batch = seen.living.shape[1]
    sent = np.bincount(seen.place // seats, weights=seen.gate.detach().cpu().numpy(), minlength=batch)
    return np.asarray(sent / np.maximum(seen.living.sum((0, 2)), 1))


def grid(rows: Floats, seen: Unrolled) -> Floats:
    """Rows (M,) spread over (T, B, N), zeros elsewhere."""
    spread = np.zeros((len(seen.living), seen.living[0].size), np.float32)
    spread[seen.step, seen.place] = rows
    return spread.reshape(seen.living.shape)


def advantages(
    rewards: Floats, values: Floats, continues: NDArray[np.bool_], gamma: float, lam: float
) -> Floats:
    """Generalised advantages (T, B, N): each agent's, until it leaves, is replaced or the episode ends."""
    result = np.zeros_like(rewards)
    running = np.zeros_like(rewards[0])
    value_after = np.zeros_like(rewards[0])
    for step in reversed(range(len(rewards))):
        go_on = continues[step].astype(np.float32)
        delta = rewards[step] + gamma * go_on * value_after - values[step]
        running = (delta + gamma * lam * go_on * running).astype(np.float32)
        result[step] = running
        value_after = values[step]
    return result
