"""Training plays by the order that people meet: the same talk, actions and memory as ``Team``."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from models import rollout
from models.envs import registry
from models.envs.starts import human_start
from models.envs.traffic_junction import with_arrival
from models.policies.recurrent import Architecture, Memory, RecurrentNet, RecurrentPolicy
from models.policies.team import Team
from models.training.unroll import Beginning, Manner, Mind, unroll, warmed_up

GREEDY = Manner(sampled=False)


def net_for(env, channel="prototype", gate="learned", seed=0):
    tokens = 6 if channel in ("prototype", "one-hot") else 0
    torch.manual_seed(seed)
    net = RecurrentNet(Architecture(env.observation_size, env.actions, 10, 6, tokens, channel, gate))
    if net.gate is not None:
        with torch.no_grad():
            net.gate[-1].weight.mul_(8)  # so that some gates are open and some are not
    return net


def seeds(count):
    return np.arange(count, dtype=np.uint64)


@pytest.mark.parametrize("channel", ["continuous", "prototype", "one-hot", "none"])
@pytest.mark.parametrize("task", ["traffic_junction/medium", "parent_child"])
def test_training_and_play_agree_in_every_token_gate_and_action(task, channel):
    env = registry.make(task)
    net = net_for(env, channel)
    state = env.init(seeds(12))
    if task.startswith("traffic"):
        state = with_arrival(state, 0.2)
    seen = unroll(env, net, Beginning(state, None), GREEDY, torch.Generator())
    played = rollout.episodes(
        env, Team(env, RecurrentPolicy(net)), seeds(12), arrival=0.2 if task.startswith("traffic") else None
    )
    assert np.array_equal(seen.living, played.alive)
    at = (seen.step, seen.place // env.agents, seen.place % env.agents)
    speaks = env.speaks[seen.place % env.agents] & (not env.message_held or seen.step == 0)
    assert np.array_equal(seen.action.numpy(), played.actions[at])
    assert np.array_equal(seen.token.numpy()[speaks], played.tokens[at][speaks])
    assert np.array_equal((seen.gate.detach().numpy() > 0.5)[speaks], played.gates[at][speaks])
    assert np.array_equal(np.where(seen.living, seen.rewards, 0), np.where(played.alive, played.rewards, 0))


def test_a_warm_up_leaves_the_same_memory_in_training_and_in_play():
    env = registry.make("traffic_junction/medium")
    net, begun = net_for(env), human_start(env, seeds(5))
    team = Team(env, RecurrentPolicy(net))
    played = rollout.warmed_up(team, begun).hidden
    warm = torch.cat(warmed_up(env, net, begun, GREEDY, torch.Generator()), 1)
    trained = warm.numpy().reshape(*played.shape[:2], -1)
    driving = env.alive(begun.state) & ~env.fresh(begun.state)
    assert driving.sum() >= 20
    lasting = played[driving][:, : trained.shape[2]]  # what follows is only kept within a step
    np.testing.assert_allclose(trained[driving], lasting, atol=1e-4)


def test_windows_of_an_episode_are_the_episode():
    env = registry.make("traffic_junction/easy")
    net = net_for(env)
    start = Beginning(with_arrival(env.init(seeds(6)), 0.3), None)
    whole = unroll(env, net, start, GREEDY, torch.Generator())
    first = unroll(env, net, start, GREEDY, torch.Generator(), steps=range(8))
    rest = unroll(
        env, net, Beginning(first.states[-1], first.memory), GREEDY, torch.Generator(), steps=range(8, 20)
    )
    assert rest.step.min() == 0
    assert np.array_equal(np.concatenate([first.living, rest.living]), whole.living)
    torch.testing.assert_close(torch.cat([first.logits, rest.logits]), whole.logits, atol=1e-4, rtol=1e-4)


def test_a_listeners_loss_teaches_the_speaker_and_a_closed_gate_teaches_nobody():
    env = registry.make("traffic_junction/medium")
    for gate_bias, taught in ((50.0, True), (-50.0, False)):
        net = net_for(env, "continuous")
        with torch.no_grad():
            net.gate[-1].bias.fill_(gate_bias)
        begin = Beginning(with_arrival(env.init(seeds(4)), 0.2), None)
        seen = unroll(env, net, begin, GREEDY, torch.Generator())
        seen.logits.square().sum().backward()
        assert bool(net.speech[2].weight.grad.abs().sum() > 0) == taught


def test_the_gate_learns_from_the_listeners_even_while_it_is_closed():
    env = registry.make("traffic_junction/medium")
    net = net_for(env, "continuous")
    with torch.no_grad():
        net.gate[-1].weight.zero_()
        net.gate[-1].bias.fill_(-0.5)
    begin = Beginning(with_arrival(env.init(seeds(4)), 0.2), None)
    seen = unroll(env, net, begin, GREEDY, torch.Generator())
    assert not seen.gate.detach().any()
    seen.logits.square().sum().backward()
    assert net.gate[-1].bias.grad.abs() > 0


def test_only_living_agents_go_through_the_network():
    env = registry.make("traffic_junction/medium")
    begin = Beginning(with_arrival(env.init(seeds(20)), 0.05), None)
    seen = unroll(env, net_for(env), begin, GREEDY, torch.Generator())
    assert len(seen.step) == seen.living.sum() < 0.5 * seen.living.size


def test_a_new_occupant_ends_the_stretch_of_the_old_one():
    env = registry.make("traffic_junction/easy")
    begin = Beginning(with_arrival(env.init(seeds(40)), 0.6), None)
    gas = unroll(
        env, net_for(env), begin, GREEDY, torch.Generator(), override=lambda _t, _s, actions: 0 * actions
    )
    fresh = np.stack([env.fresh(state) for state in gas.states[1:]])
    replaced = gas.living & env_alive(env, gas.states[1:]) & fresh
    assert replaced.any()
    assert not gas.continues[replaced].any()
    assert not gas.continues[-1].any()


def env_alive(env, states):
    return np.stack([env.alive(state) for state in states])


def test_draws_come_again_from_the_same_generator():
    env = registry.make("traffic_junction/easy")
    net = net_for(env)
    begin = Beginning(with_arrival(env.init(seeds(6)), 0.4), None)
    manner = Manner(sampled=True, explore=0.2)
    one, other = (unroll(env, net, begin, manner, torch.Generator().manual_seed(5)) for _ in range(2))
    assert torch.equal(one.action, other.action)
    assert torch.equal(one.gate, other.gate)
    greedy = unroll(env, net, begin, replace(manner, sampled=False, explore=0.0), torch.Generator())
    assert not np.array_equal(greedy.living, one.living) or not torch.equal(greedy.action, one.action)


def test_seats_that_nobody_moved_forget():
    env = registry.make("traffic_junction/easy")
    mind = Mind(env, net_for(env), 2, GREEDY)
    mind.keep(np.array([3]), Memory(*(torch.ones(1, 10) for _ in range(4))))
    memory = torch.cat(mind.memories(), 1)
    assert memory[3].all()
    assert memory.sum() == 40
