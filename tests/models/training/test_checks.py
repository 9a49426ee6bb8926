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
        net.gate[-1].weight.mul_(4)
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
    assert moved == ["gate.2.bias"]
    assert 0 < (net.gate[-1].bias - before["gate.2.bias"]).item() <= REACH


@pytest.mark.parametrize("aside", [-0.03, 0.03])
def test_talking_off_the_budget_costs_score_on_either_side(env, net, aside):
    calibrate(env, net, 0.5, SETTINGS)
    free = check(env, net, Phase(name="x", gate="learned"), SETTINGS)
    assert 0.03 < free.message_rate < 0.97
    held = check(env, net, Phase(name="x", gate="budget", budget=free.message_rate + aside), SETTINGS)
    assert held.message_rate == free.message_rate
    assert held.score == pytest.approx(free.score - 2 * (abs(aside) - 0.01))


@pytest.mark.parametrize(("drawn", "cost"), [(0.5, 0), (0.54, 0), (0.46, 0), (0.9, 0.7), (0.1, 0.7)])
def test_gates_drawn_off_the_budget_cost_score_although_greedy_ones_keep_it(env, net, drawn, cost):
    calibrate(env, net, 0.5, SETTINGS)
    phase = Phase(name="x", gate="enforced", budget=0.5)
    free, held = check(env, net, phase, SETTINGS), check(env, net, phase, SETTINGS, drawn)
    assert free[:-1] == pytest.approx(held[:-1], nan_ok=True)
    assert held.score == pytest.approx(free.score - cost)


def test_the_score_is_the_reward_where_a_recipe_says_so(env, net):
    by_success = check(env, net, Phase(name="x"), SETTINGS)
    by_reward = check(env, net, Phase(name="x"), Check(episodes=60, score="reward"))
    assert by_reward.score == by_reward.reward == by_success.reward < 0
    assert by_success.score == by_success.success


def test_an_open_phase_is_judged_with_every_message_sent(env, net):
    checked = check(env, net, Phase(name="x"), SETTINGS)
    assert checked.message_rate == 1
    assert checked.score == checked.success
    assert checked.human != checked.human  # no human trials asked for: nan


def test_a_hunt_can_be_judged_by_what_it_earns():
    hunt = registry.make("predator_prey/5x5")
    net = RecurrentNet(Architecture(hunt.observation_size, hunt.actions, 12, 6, 5, "prototype", "open"))
    plain = check(hunt, net, Phase(name="x"), SETTINGS)
    judged = check(hunt, net, Phase(name="x"), Check(episodes=60, score="reward"))
    played = rollout.episodes(hunt, Team(hunt, RecurrentPolicy(net)), check_seeds(60))
    earned = played.rewards[..., :-1].sum(0).mean()
    assert plain.score == plain.success
    assert judged.score == judged.reward == pytest.approx(earned)
