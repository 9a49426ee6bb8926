"""How good is the policy now? Greedy episodes on held-out situations; their score decides what is kept."""

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import nn

from models import rollout
from models.envs.api import Environment
from models.policies.recurrent import RecurrentNet, RecurrentPolicy
from models.policies.team import Team
from models.training.config import Check, Phase
from models.training.situations import check_seeds

OFF_BUDGET = 2.0  # score lost per message rate away from the budget, beyond the tolerance
TOLERANCE = 0.01
DRAWN_TOLERANCE = 0.05  # ... by which the gates that training draws may miss it; they are noisy
HALVINGS = 12  # of the interval in which the gate's threshold is looked for: to 16 / 2**12 = .004
CLOSE = 0.003  # a message rate so near below the budget is good enough
REACH = 8.0  # largest move of the threshold, in the logit: gates drawn with .9997 can be closed too


class Checked(NamedTuple):
    """One evaluation; human trials are nan where the recipe asks for none."""

    success: float
    """Share of episodes from ``init`` that went well."""
    human: float
    """Share of human trials in which no car met another, in all steps."""
    arrived: float
    """Share of human trials in which the participant's car arrived."""
    steps: float
    """Mean length of the episodes from ``init``."""
    reward: float
    """Summed over each of them, mean over the seats."""
    message_rate: float
    """Messages per living agent and step, from ``init``."""
    human_rate: float
    """... in human trials."""
    tokens_used: int
    """Different tokens sent, from ``init``."""
    score: float
    """What is to be maximised."""


def check(
    env: Environment[Any], net: RecurrentNet, phase: Phase, settings: Check, drawn_rate: float | None = None
) -> Checked:
    """Evaluate with the messages and the gate of this phase.

    Args:
        env: the world.
        net: what people would meet.
        phase: what it is taught now.
        settings: how to judge.
        drawn_rate: share of messages that the last update sent, with gates drawn. Off the budget it costs
            score too: greedy gates keep the budget by their threshold alone, and the agent that is kept
            could be one whose gates have not learned any yet.
    """
    team = Team(env, RecurrentPolicy(net, phase.discrete, phase.gate == "open"))
    played = rollout.episodes(env, team, check_seeds(settings.episodes))
    success, steps = float(played.success.mean()), float(played.steps.mean())
    reward = float(played.rewards.sum(axis=(0, 2), dtype=np.float64).mean()) / env.agents
    human = arrived = human_rate = float("nan")
    score = reward if settings.score == "reward" else success
    score -= settings.steps_weight * steps / env.steps_max
    rates = [played.message_rate]
    if settings.human:
        trial = rollout.episodes(env, team, check_seeds(settings.human), "human")
        human, human_rate = float(trial.success.mean()), trial.message_rate
        arrived = float(rollout.trials(trial).arrived.mean())
        score = (1 - settings.human_weight) * score + settings.human_weight * (human + arrived) / 2
        rates.append(human_rate)
    if phase.budget is not None:
        missed = [abs(rate - phase.budget) - TOLERANCE for rate in rates]
        if drawn_rate is not None:
            missed.append(abs(drawn_rate - phase.budget) - DRAWN_TOLERANCE)
        score -= OFF_BUDGET * sum(max(0.0, each) for each in missed)
    used = len(np.unique(played.tokens[played.gates]))
    return Checked(success, human, arrived, steps, reward, rates[0], human_rate, used, score)


@torch.no_grad()
def calibrate(env: Environment[Any], net: RecurrentNet, budget: float, settings: Check) -> None:
    """Move the gate's threshold, in place, so that greedy gates send what drawn gates learned to send.

    Where a gate is open with probability .4 it is drawn open two times in five, but greedily never. The most
    talkative threshold is taken at which neither episodes from ``init`` nor human trials exceed the budget.
    """
    assert net.gate is not None
    gate = net.gate[-1]
    assert isinstance(gate, nn.Linear)
    before = gate.bias.clone()
    low, high = -REACH, REACH
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        gate.bias.copy_(before + middle)
        rate = _rate(env, net, settings)
        low, high = (middle, high) if rate <= budget else (low, middle)
        if 0 <= budget - rate < CLOSE:
            break
    gate.bias.copy_(before + low)


def _rate(env: Environment[Any], net: RecurrentNet, settings: Check) -> float:
    """The larger message rate of episodes from ``init`` and of human trials."""
    team = Team(env, RecurrentPolicy(net))
    rates = [rollout.episodes(env, team, check_seeds(settings.episodes)).message_rate]
    if settings.human:
        rates.append(rollout.episodes(env, team, check_seeds(settings.human), "human").message_rate)
    return max(rates)
