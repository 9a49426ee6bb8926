import numpy as np
import pytest

from models.interpret.nulls import in_use, information
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
