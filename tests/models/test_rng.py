import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models import rng

u64 = st.integers(0, 2**64 - 1)


@given(u64, u64, u64, u64)
def test_a_scalar_draw_and_a_batched_draw_agree(seed: int, stream: int, step: int, index: int) -> None:
    batched = rng.words(np.array([seed, 0], np.uint64), stream, np.array([step, step], np.uint64), index)

    assert int(batched[0]) == rng.word(seed, stream, step, index)


@given(u64, u64, st.integers(1, 2**31 - 1), st.floats(0, 1))
def test_scalar_and_batched_decisions_agree(seed: int, index: int, n: int, p: float) -> None:
    one = rng.word(seed, 0, 0, index)
    many = np.array([one], np.uint64)

    assert int(rng.below(many, n)[0]) == rng.below(one, n)
    assert bool(rng.chance(many, rng.threshold(p))[0]) == rng.chance(one, rng.threshold(p))


@given(u64, st.integers(1, 2**31 - 1))
def test_below_stays_below(word: int, n: int) -> None:
    assert 0 <= rng.below(word, n) < n


def test_parts_broadcast_against_each_other() -> None:
    drawn = rng.words(np.arange(3)[:, None], 1, 2, np.arange(4))

    assert drawn.shape == (3, 4)
    assert drawn.dtype == np.uint64
    assert [[rng.word(b, 1, 2, i) for i in range(4)] for b in range(3)] == drawn.tolist()


def test_four_plain_numbers_give_one_word_without_a_warning() -> None:
    assert int(rng.words(2**64 - 1, 1, 2, 3)) == rng.word(2**64 - 1, 1, 2, 3)


def test_the_finaliser_is_that_of_splitmix64() -> None:
    # first outputs of splitmix64 from state 0, as published with the algorithm
    assert rng._finish(rng._GAMMA) == 0xE220A8397B1DCDAF
    assert rng._finish(2 * rng._GAMMA % 2**64) == 0x6E789E6AA1B965F4


def test_every_part_of_the_counter_matters() -> None:
    words = {rng.word(*parts) for parts in np.ndindex(5, 5, 5, 5)}

    assert len(words) == 5**4


def test_draws_are_uniform_over_their_range() -> None:
    drawn = rng.below(rng.words(np.arange(60_000), 0, 0, 0), 6)
    expected = 10_000

    chi_square = float(((np.bincount(drawn, minlength=6) - expected) ** 2 / expected).sum())

    assert chi_square < 20.5  # 5 degrees of freedom, p = .001


@pytest.mark.parametrize("axis", ["seed", "stream", "step", "index"])
def test_neighbouring_counters_give_independent_bits(axis: str) -> None:
    parts = {"seed": 3, "stream": 1, "step": 4, "index": 1, axis: np.arange(20_000)}
    upper = (rng.words(**parts) >> np.uint64(32)).astype(np.float64) / 2**32

    assert abs(np.corrcoef(upper[:-1], upper[1:])[0, 1]) < 0.03
    assert abs(upper.mean() - 0.5) < 0.01


def test_chance_zero_never_happens_and_chance_one_always() -> None:
    drawn = rng.words(np.arange(1000), 0, 0, 0)

    assert not rng.chance(drawn, rng.threshold(0.0)).any()
    assert rng.chance(drawn, rng.threshold(1.0)).all()
    assert not rng.chance(0, rng.threshold(0.0))
    assert rng.chance(2**64 - 1, rng.threshold(1.0))


@pytest.mark.parametrize("p", [-0.1, 1.1, float("nan")])
def test_a_number_that_is_no_probability_is_refused(p: float) -> None:
    with pytest.raises(ValueError, match="between 0 and 1"):
        rng.threshold(p)
