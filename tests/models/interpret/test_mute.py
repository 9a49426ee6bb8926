import numpy as np
import pytest

from models.envs import registry
from models.evaluate import Question, evaluate
from models.interpret.mute import WithoutNulls
from models.policies.team import Team
from models.rollout import episodes
from tests.models.interpret.speakers import Honest
from tests.models.policies.bundles import tiny_policy

MEDIUM = registry.make("traffic_junction/medium")
SEEDS = np.arange(40, dtype=np.uint64)


def test_only_messages_with_a_null_token_are_held_back() -> None:
    policy = Honest(MEDIUM)
    null = np.arange(policy.tokens) % 2 == 0
    before = episodes(MEDIUM, Team(MEDIUM, policy), SEEDS)
    after = episodes(MEDIUM, Team(MEDIUM, WithoutNulls(policy, null)), SEEDS)
    assert np.array_equal(before.cells, after.cells)  # honest drivers do not listen
    said = before.gates & before.alive
    assert after.gates[said].tolist() == (~null[before.tokens[said]]).tolist()


def test_without_any_message_a_policy_does_what_it_does_when_nobody_hears() -> None:
    policy = tiny_policy("traffic_junction/medium")
    muted = Team(MEDIUM, WithoutNulls(policy, np.ones(policy.tokens, bool)))
    silent = evaluate(MEDIUM, muted, Question(60, seed=2))
    masked = evaluate(MEDIUM, Team(MEDIUM, policy), Question(60, seed=2, masked=True))
    assert silent["message_rate"].mean == 0
    assert silent["reward"] == masked["reward"]


def test_flags_of_another_codebook_are_refused() -> None:
    with pytest.raises(ValueError, match="9 tokens, but null flags for 3"):
        WithoutNulls(tiny_policy(), np.zeros(3, bool))
