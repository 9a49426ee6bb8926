import numpy as np
import pytest
import torch

from models.envs import registry
from models.interpret.estimate import ESTIMATION, estimate, hearable, lives, seed_batches
from models.policies.recurrent import Architecture, RecurrentNet, RecurrentPolicy
from models.rollout import trials
from tests.models.interpret.speakers import Babbler, Honest
from tests.models.policies.bundles import tiny_policy

MEDIUM = registry.make("traffic_junction/medium")


def test_what_an_honest_speaker_means_is_its_own_cell() -> None:
    policy = Honest(MEDIUM)
    lexicon = estimate(MEDIUM, policy, 150, seed=1)
    said = lexicon.uses >= len(policy.road)
    assert said.sum() > 20
    assert (lexicon.probability[said].argmax(axis=1) == policy.road[said]).all()
    assert lexicon.probability[said].max(axis=1).min() == 1.0
    assert not lexicon.null[said].any()
    assert lexicon.null[~said].all()


def test_babble_is_null() -> None:
    lexicon = estimate(MEDIUM, Babbler(MEDIUM), 150, seed=1)
    assert lexicon.null.all()
    assert (lexicon.uses[:2] > 1000).all()


def test_only_what_a_participant_hears_is_counted() -> None:
    rollout = next(lives(MEDIUM, Honest(MEDIUM), 40, 3, ESTIMATION))
    heard = hearable(MEDIUM, rollout)
    assert not heard[..., -1].any()
    lasts = trials(rollout).steps
    for episode in range(40):
        assert not heard[lasts[episode] :, episode].any()
        assert heard[0, episode].sum() == rollout.alive[0, episode].sum() - 1


def test_closed_gates_leave_an_empty_lexicon() -> None:
    lexicon = estimate(MEDIUM, Honest(MEDIUM, gate_open=False), 5, seed=1)
    assert lexicon.samples == 0
    assert lexicon.null.all()


def test_a_held_message_counts_once_per_episode() -> None:
    env = registry.make("parent_child")
    lexicon = estimate(env, tiny_policy(), 300, seed=2)
    assert lexicon.samples == 300


@pytest.mark.parametrize("gate", ["open", "learned"])
def test_in_a_hunt_every_message_that_was_sent_counts(gate: str) -> None:
    env = registry.make("predator_prey/10x10")
    policy = tiny_policy(env.name, gate=gate)
    if gate == "learned":
        with torch.no_grad():
            policy.net.gate[-1].bias.fill_(-0.2)  # sometimes open, sometimes closed
    rollouts = list(lives(env, policy, 30, 2, ESTIMATION))
    sent = sum(int(rollout.gates.sum()) for rollout in rollouts)

    assert all(hearable(env, rollout).sum() == rollout.gates.sum() for rollout in rollouts)
    assert estimate(env, policy, 30, seed=2).samples == sent
    slots = 30 * env.steps_max * env.agents
    assert sent == slots if gate == "open" else 0 < sent < slots


def test_the_same_seed_gives_the_same_lexicon_and_another_seed_another() -> None:
    env = registry.make("parent_child")
    one, same, other = (estimate(env, tiny_policy(), 100, seed=seed) for seed in (4, 4, 5))
    assert np.array_equal(one.probability, same.probability)
    assert np.array_equal(one.positions, same.positions)
    assert not np.array_equal(one.uses, other.uses)


def test_an_episodes_seed_does_not_depend_on_the_batch_and_streams_never_meet() -> None:
    whole = np.concatenate(list(seed_batches(25, 1, 9, batch=25)))
    parts = np.concatenate(list(seed_batches(25, 1, 9, batch=7)))
    other = np.concatenate(list(seed_batches(25, 1, 10)))
    assert np.array_equal(whole, parts)
    assert not set(whole.tolist()) & set(other.tolist())


def test_a_channel_without_tokens_is_refused() -> None:
    env = registry.make("parent_child")
    net = RecurrentNet(Architecture(env.observation_size, env.actions, 4, 3, 0, "continuous", "open"))
    with pytest.raises(ValueError, match="continuous channel has no tokens"):
        estimate(env, RecurrentPolicy(net), 1, seed=0)
