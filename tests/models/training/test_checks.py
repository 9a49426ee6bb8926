"""Checks judge what people would meet: greedy gates within the budget."""

import pytest
import torch

from models import rollout
from models.envs import registry
from models.policies.recurrent import Architecture, RecurrentNet, RecurrentPolicy
from models.policies.team import Team
from models.training.checks import REACH, calibrate, check
from models.training.config import Check, Phase
from models.training.situations import check_seeds

SETTINGS = Check(episodes=60)


@pytest.fixture
def env():
    return registry.make("traffic_junction/medium")


@pytest.fixture
def net(env):
    """Gates whose logits differ from step to step by about one."""
    torch.manual_seed(3)
    net = RecurrentNet(Architecture(env.observation_size, env.actions, 12, 6, 5, "prototype", "learned"))
    with torch.no_grad():
        net.gate.weight.mul_(4)
    return net


def rate(env, net):
    return rollout.episodes(env, Team(env, RecurrentPolicy(net)), check_seeds(60)).message_rate


@pytest.mark.parametrize("budget", [0.2, 0.5, 0.8])
def test_a_threshold_is_found_that_uses_the_budget_and_keeps_to_it(env, net, budget):
    calibrate(env, net, budget, SETTINGS)
    assert budget - 0.1 < rate(env, net) <= budget


def test_nothing_but_the_threshold_moves_and_not_far(env, net):
    before = {name: value.clone() for name, value in net.state_dict().items()}
    calibrate(env, net, 1.0, SETTINGS)
    moved = [name for name, value in net.state_dict().items() if not torch.equal(value, before[name])]
    assert moved == ["gate.bias"]
    assert 0 < (net.gate.bias - before["gate.bias"]).item() <= REACH


def test_talking_over_the_budget_costs_score(env, net):
    free = check(env, net, Phase(name="x", gate="learned"), SETTINGS)
    tight = check(env, net, Phase(name="x", gate="budget", budget=0.05), SETTINGS)
    assert free.message_rate == tight.message_rate > 0.1
    assert tight.score == pytest.approx(free.score - 2 * (free.message_rate - 0.05 - 0.01))


def test_an_open_phase_is_judged_with_every_message_sent(env, net):
    checked = check(env, net, Phase(name="x"), SETTINGS)
    assert checked.message_rate == 1
    assert checked.score == checked.success
    assert checked.human != checked.human  # no human trials asked for: nan


def test_a_hunt_can_be_judged_by_what_it_earns():
    hunt = registry.make("predator_prey/5x5")
    net = RecurrentNet(Architecture(hunt.observation_size, hunt.actions, 12, 6, 5, "prototype", "open"))
    plain = check(hunt, net, Phase(name="x"), SETTINGS)
    judged = check(hunt, net, Phase(name="x"), Check(episodes=60, reward_weight=0.5))
    played = rollout.episodes(hunt, Team(hunt, RecurrentPolicy(net)), check_seeds(60))
    earned = played.rewards[..., :-1].sum(0).mean()
    assert plain.score == plain.success
    assert judged.score == pytest.approx(judged.success + 0.5 * earned)
