"""Returns, advantages and losses against sums done by hand."""

import numpy as np
import pytest
import torch

from models.envs import registry
from models.envs.traffic_junction import with_arrival
from models.policies.recurrent import Architecture, RecurrentNet
from models.training.config import Decoder, Phase
from models.training.enforcer import Enforcer
from models.training.imitation import intent
from models.training.reinforce import (
    Learner,
    advantages,
    budget_loss,
    gradient_loss,
    imitation_loss,
    shaped,
    shares,
)
from models.training.similarity import occupancy, similarity_loss
from models.training.unroll import Beginning, Manner, unroll


def column(*values):
    return np.array(values, np.float32)[:, None, None]


@pytest.fixture(scope="module")
def env():
    return registry.make("traffic_junction/medium")


@pytest.fixture(scope="module")
def learner(env):
    torch.manual_seed(0)
    sizes = Architecture(env.observation_size, env.actions, 8, 4, 5, "prototype", "learned")
    return Learner(env, RecurrentNet(sizes), Decoder(target="occupancy", reads="inbox"))


@pytest.fixture(scope="module")
def seen(env, learner):
    state = with_arrival(env.init(np.arange(30, dtype=np.uint64)), 0.2)
    with torch.no_grad():
        return unroll(env, learner.net, Beginning(state, None), Manner(), torch.Generator().manual_seed(1))


def test_with_lambda_one_the_advantage_is_the_return_minus_the_value():
    rewards, values = column(1, 2, 3), column(0.5, 0.25, 2)
    go_on = column(1, 1, 0) > 0
    got = advantages(rewards, values, go_on, gamma=0.5, lam=1.0)
    np.testing.assert_allclose(got.ravel(), [1 + 1 + 0.75 - 0.5, 2 + 1.5 - 0.25, 3 - 2])


def test_with_lambda_zero_the_advantage_is_the_error_of_one_step():
    rewards, values = column(1, 2, 3), column(0.5, 0.25, 2)
    got = advantages(rewards, values, column(1, 1, 0) > 0, gamma=0.5, lam=0.0)
    np.testing.assert_allclose(got.ravel(), [1 + 0.125 - 0.5, 2 + 1 - 0.25, 1])


def test_nothing_flows_from_a_new_occupant_to_the_old_one():
    rewards, values = column(0, 0, -10), column(0, 0, 0)
    got = advantages(rewards, values, column(1, 0, 1) > 0, gamma=1.0, lam=1.0)
    np.testing.assert_allclose(got.ravel(), [0, 0, -10])


def test_only_the_first_collision_counts_where_the_recipe_says_so(env, seen):
    plain = shaped(env, seen, Phase(name="x"))
    once = shaped(env, seen, Phase(name="x", first_collision_only=True))
    crashes, first = (-plain / 10).round().sum(), (-once / 10).round().sum()
    assert 0 < first < crashes
    assert (once >= plain).all()


def test_a_shared_reward_keeps_the_sum_of_every_step(env, seen):
    plain, shared = shaped(env, seen, Phase(name="x")), shaped(env, seen, Phase(name="x", shared=1.0))
    np.testing.assert_allclose(shared.sum(2), plain.sum(2), atol=1e-3)
    row = seen.living[20, 0]
    assert len(set(shared[20, 0][row].tolist())) == 1


def test_the_enforcers_penalty_falls_on_episodes_away_from_the_budget(env, seen):
    share = shares(seen)
    phase = Phase(name="x", gate="enforced", budget=0.5)
    paid = shaped(env, seen, Phase(name="x")) - shaped(env, seen, phase, Enforcer(0.5))
    each = np.array([paid[:, episode][seen.living[:, episode]].mean() for episode in range(30)])
    np.testing.assert_allclose(each, Enforcer(0.5).penalty(share), rtol=1e-2, atol=1e-4)


def test_shares_count_messages_of_the_living(seen):
    gates = seen.gate.numpy()
    first = seen.place // 10 == 0
    assert shares(seen)[0] == pytest.approx(gates[first].sum() / seen.living[:, 0].sum())
    assert 0 < shares(seen).mean() < 1


def test_the_budget_loss_is_zero_on_the_budget(env, seen):
    rate = float(seen.gate.mean())
    assert budget_loss(env, seen, rate).item() == pytest.approx(0, abs=1e-9)
    assert budget_loss(env, seen, 1.0).item() == pytest.approx((1 - rate) ** 2, rel=1e-4)


def test_a_brake_that_was_missed_weighs_more():
    logits = torch.tensor([[0.0, 0.0], [0.0, 3.0]])
    labels = torch.tensor([1, 0])
    missed, other = np.log(2), np.log(1 + np.exp(3))
    assert imitation_loss(logits, labels, 4.0).item() == pytest.approx((4 * missed + other) / 5)


def test_the_decoder_is_asked_for_the_others_only(env, seen):
    target = occupancy(env, seen)
    size = len(env.roads.road_cells)
    row = int(np.flatnonzero(seen.step == 30)[0])
    state, seat = seen.states[30], seen.place[row] % 10
    others = [n for n in range(10) if n != seat and seen.living[30, 0, n]]
    now = {env.cell_of(state)[0, n] for n in others}
    then = {intent(env, state)[0, n] for n in others} - {-1}
    assert set(env.roads.road_cells[target[row, :size] > 0]) == now
    assert set(env.roads.road_cells[target[row, size:] > 0]) == then


def test_all_parts_of_the_loss_reach_their_weights(env, learner):
    state = with_arrival(env.init(np.arange(6, dtype=np.uint64)), 0.2)
    phase = Phase(name="x", gate="budget", budget=0.5, decoder_weight=0.1, imitation_weight=0.1)
    batch = unroll(env, learner.net, Beginning(state, None), Manner(), torch.Generator().manual_seed(1))
    loss = gradient_loss(env, learner, batch, phase, 0.01, None, np.zeros(len(batch.step), np.int64))
    assert set(loss.parts) == {
        "policy", "entropy", "value", "gate", "channel", "imitation", "decoder", "budget"
    }  # fmt: skip
    assert loss.total.item() == pytest.approx(sum(loss.parts.values()), rel=1e-4)
    loss.total.backward()
    assert all(weight.grad is not None for weight in learner.parameters())
    learner.zero_grad()


@pytest.mark.parametrize("target", ["location", "coordinates"])
def test_parent_and_child_read_the_speakers_place(target):
    world = registry.make("parent_child")
    torch.manual_seed(0)
    sizes = Architecture(world.observation_size, world.actions, 8, 4, 5, "prototype", "open")
    student = Learner(world, RecurrentNet(sizes), Decoder(target=target, reads="inbox"))
    begin = Beginning(world.init(np.arange(16, dtype=np.uint64)), None)
    losses = []
    optimiser = torch.optim.Adam(student.parameters(), lr=0.01)
    for _ in range(20):
        batch = unroll(world, student.net, begin, Manner(discrete=False), torch.Generator().manual_seed(2))
        loss = similarity_loss(world, student.decoder, batch)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert 0 < losses[-1] < 0.8 * losses[0]
