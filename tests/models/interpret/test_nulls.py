import numpy as np
import pytest

from models.interpret.nulls import in_use, information, kinds, sensitivity
from models.policies.lexicon import Lexicon


def test_one_token_per_cell_tells_everything() -> None:
    found = information(Lexicon.from_counts(np.eye(8, dtype=int) * 50, positions=np.full((8, 2), 0.5)))
    assert found.prior_bits == pytest.approx(3)
    assert found.mutual_bits == pytest.approx(3)
    assert found.null_messages == 0


def test_messages_of_null_tokens_are_counted_by_use() -> None:
    counts = np.array([[300, 0, 0, 0], [0, 300, 0, 0], [50, 50, 50, 50], [0, 0, 100, 100]])
    found = information(Lexicon.from_counts(counts, positions=np.full((4, 2), 0.5)))
    assert found.null_messages == pytest.approx(200 / 1000)
    assert found.told_bits[2] < found.needed_bits < found.told_bits[0]


def test_a_token_is_in_use_from_one_percent_of_the_messages_on() -> None:
    assert in_use(np.array([990, 10, 9])).tolist() == [True, False, False]
    assert in_use(np.array([985, 10, 5])).tolist() == [True, True, False]


def test_of_many_tokens_a_tenth_of_an_even_share_is_use() -> None:
    uses = np.full(100, 10)
    uses[0], uses[1] = 2, 0
    assert in_use(uses).sum() == 99


def test_nothing_said_is_nothing_in_use() -> None:
    assert not in_use(np.zeros(9)).any()
    assert in_use(np.zeros((3, 0))).shape == (3, 0)


def test_tokens_are_null_for_three_reasons() -> None:
    counts = np.array(
        [[300, 0, 0, 0], [0, 300, 0, 0], [50, 60, 50, 50], [0, 0, 100, 100], [1, 0, 0, 0], [0] * 4]
    )
    assert kinds(Lexicon.from_counts(counts, positions=np.full((6, 2), 0.5))) == (1, 1, 1, 3)


def test_the_threshold_in_use_gives_the_null_tokens_and_a_higher_one_never_fewer() -> None:
    rng = np.random.default_rng(0)
    counts = np.array(
        [rng.multinomial(800, rng.dirichlet(np.full(12, a))) for a in np.geomspace(0.1, 90, 30)]
    )
    lexicon = Lexicon.from_counts(counts, positions=np.full((30, 2), 0.5))
    rows = {row.threshold: row for row in sensitivity(lexicon)}
    assert list(rows) == [0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert rows[0.1].tokens == lexicon.null.sum()
    assert rows[0.1].messages == pytest.approx(information(lexicon).null_messages)
    tokens = [row.tokens for row in rows.values()]
    assert tokens == sorted(tokens)
    assert tokens[0] < tokens[2] < tokens[-1]
