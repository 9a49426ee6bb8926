import numpy as np

from models.envs import registry
from models.policies.lexicon import Lexicon
from models.removal import removal
from tests.models.interpret.speakers import Babbler, Honest
from tests.models.policies.bundles import tiny_policy

MEDIUM = registry.make("traffic_junction/medium")


def lexicon(tokens: int, cells: int, told: bool) -> Lexicon:
    counts = np.full((tokens, cells), 10)
    if told:
        counts = np.where(np.arange(cells) % tokens == np.arange(tokens)[:, None], 90, 0)
    return Lexicon.from_counts(counts, np.full((tokens, 2), 0.5))


def test_who_babbles_loses_every_message_and_nothing_else() -> None:
    policy = Babbler(MEDIUM)
    found = removal(MEDIUM, policy, lexicon(policy.tokens, MEDIUM.cells, told=False), 40, seed=1)
    assert found is not None
    assert set(found) == {"init", "human"}
    for start, key in (("init", "success"), ("human", "arrived")):
        before, after = found[start]["before"], found[start]["after"]
        assert (before["message_rate"]["mean"], after["message_rate"]["mean"]) == (1, 0)
        assert before[key] == after[key]  # it does not listen either


def test_a_language_without_null_messages_has_nothing_to_remove() -> None:
    policy = Honest(MEDIUM)
    assert removal(MEDIUM, policy, lexicon(policy.tokens, MEDIUM.cells, told=True), 10, seed=1) is None


def test_a_search_is_compared_in_its_own_start() -> None:
    env = registry.make("parent_child")
    found = removal(env, tiny_policy(), lexicon(9, env.cells, told=False), 20, seed=1)
    assert found is not None
    assert set(found) == {"init"}
    assert {"found", "steps"} <= set(found["init"]["after"])
