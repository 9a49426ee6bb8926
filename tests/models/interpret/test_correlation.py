import numpy as np
import pytest

from models.interpret.correlation import EVEN, TOO_FEW, distances, mean_locations
from models.policies.lexicon import Lexicon

CORNERS = np.zeros((4, 25), int)
CORNERS[range(4), [0, 4, 20, 24]] = 100


def lexicon(counts: np.ndarray = CORNERS) -> Lexicon:
    return Lexicon.from_counts(counts, positions=np.full((len(counts), 2), 0.5))


def test_the_mean_location_is_in_rows_and_columns() -> None:
    assert mean_locations(lexicon(), (5, 5)).tolist() == [[0, 0], [0, 4], [4, 0], [4, 4]]


def test_prototypes_laid_out_like_the_grid_correlate_perfectly() -> None:
    found = distances(lexicon(), mean_locations(lexicon(), (5, 5)) * 0.5 + 3, (5, 5))
    assert found.r2 == pytest.approx(1)
    assert found.slope == pytest.approx(2)
    assert found.intercept == pytest.approx(0)
    assert len(found.pairs) == 6


def test_equally_distant_prototypes_have_an_r2_of_0_by_definition_and_say_why() -> None:
    found = distances(lexicon(), np.eye(4), (5, 5))
    assert (found.r2, found.r2_ci95, found.reason) == (0, None, EVEN)
    assert np.isnan(found.slope)


def test_two_tokens_are_too_few_for_a_line() -> None:
    found = distances(lexicon(CORNERS[:2]), np.eye(2), (5, 5))
    assert np.isnan(found.r2)
    assert found.reason == TOO_FEW


def test_a_perfect_line_has_no_doubt() -> None:
    found = distances(lexicon(), mean_locations(lexicon(), (5, 5)) * 0.5, (5, 5))
    assert found.r2_ci95 == pytest.approx((1, 1))
    assert found.slope_ci95 == pytest.approx((2, 2))


def test_resampling_tokens_doubts_more_than_resampling_pairs_would() -> None:
    rng = np.random.default_rng(0)
    counts = np.zeros((25, 25), int)
    np.fill_diagonal(counts, 100)
    places = mean_locations(lexicon(counts), (5, 5))
    vectors = places + rng.normal(size=places.shape) * 2
    found = distances(lexicon(counts), vectors, (5, 5), seed=1)
    assert found.slope_ci95 is not None
    x, y = found.prototype, found.place
    draws = rng.integers(0, len(x), (500, len(x)))
    naive = np.quantile([np.polyfit(x[d], y[d], 1)[0] for d in draws], [0.025, 0.975])
    low, high = found.slope_ci95
    assert low < found.slope < high
    assert high - low > 1.3 * np.ptp(naive)


def test_r2_is_the_squared_pearson_correlation() -> None:
    vectors = np.random.default_rng(3).normal(size=(4, 6))
    found = distances(lexicon(), vectors, (5, 5))
    assert found.r2 == pytest.approx(np.corrcoef(found.prototype, found.place)[0, 1] ** 2)
    assert found.slope == pytest.approx(np.polyfit(found.prototype, found.place, 1)[0])


def test_null_tokens_have_no_place_and_form_no_pairs() -> None:
    counts = np.concatenate([CORNERS, np.zeros((2, 25), int)])
    found = distances(lexicon(counts), np.random.default_rng(0).normal(size=(6, 2)), (5, 5))
    assert found.pairs.max() == 3
