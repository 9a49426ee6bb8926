import numpy as np
import pytest

from models.envs import registry
from models.interpret.calibration import Overlay, calibrate, judge, observe
from models.interpret.estimate import estimate
from models.policies.lexicon import Lexicon
from tests.models.interpret.speakers import Babbler, Honest

MEDIUM = registry.make("traffic_junction/medium")


def overlay(likelihood: list[list[float]], cars: list[list[int]]) -> Overlay:
    shape = np.shape(likelihood)
    return Overlay(
        trial=np.arange(shape[0]),
        likelihood=np.array(likelihood),
        own=np.zeros(shape, bool),
        spoke=np.array(cars),
        there=np.array(cars),
    )


def test_honest_speakers_are_believed() -> None:
    policy = Honest(MEDIUM)
    lexicon = estimate(MEDIUM, policy, 300, seed=1)
    judged = calibrate(MEDIUM, policy, lexicon, seed=1, count=40)
    spoke = judged["spoke"]
    assert spoke.ece == pytest.approx(0, abs=1e-12)
    assert spoke.coverage > 0.8  # tokens too rare in this small lexicon draw nothing
    assert spoke.brier_skill > 0.8
    assert judged["all_cars"] == spoke  # every car speaks


def test_babble_draws_no_triangle() -> None:
    policy = Babbler(MEDIUM)
    lexicon = estimate(MEDIUM, policy, 50, seed=1)
    spoke = calibrate(MEDIUM, policy, lexicon, seed=1, count=10)["spoke"]
    assert (spoke.drawn, spoke.coverage, spoke.bins) == (0, 0, ())


def test_the_own_cell_is_never_drawn_and_nobody_else_is_there_when_a_trial_goes_on() -> None:
    policy = Honest(MEDIUM)
    claimed = Lexicon.from_counts(
        np.full((policy.tokens, MEDIUM.cells), 10), positions=np.full((policy.tokens, 2), 0.5)
    )
    seen = observe(MEDIUM, policy, claimed, seed=2, count=10)
    assert seen.own.sum() == len(seen.trial)
    assert not seen.likelihood[seen.own].any()
    assert not seen.there[seen.own].any()


def test_calibration_error_is_the_gap_between_claim_and_share() -> None:
    claims = [[0.5, 0.0]] * 400
    cars = [[1, 0]] * 100 + [[0, 1]] * 300
    judged = judge(overlay(claims, cars), np.array(cars), 400, seed=0)
    assert judged.drawn == 400
    assert judged.ece == pytest.approx(np.mean([abs(0.5 - one.seen) for one in judged.bins]))
    assert judged.coverage == pytest.approx(100 / 400)
    low, high = judged.coverage_ci95
    assert 0.19 < low < 0.25 < high < 0.31


def test_a_perfect_claim_has_skill_one_and_the_base_rate_has_skill_zero() -> None:
    cars = np.random.default_rng(0).integers(0, 2, (200, 3))
    perfect = judge(overlay(cars.astype(float).tolist(), cars.tolist()), cars, 200, seed=0)
    base = np.tile(cars.mean(axis=0), (200, 1))
    ignorant = judge(overlay(base.tolist(), cars.tolist()), cars, 200, seed=0)
    assert (perfect.brier, perfect.brier_skill) == (0, pytest.approx(1))
    assert ignorant.brier == pytest.approx((cars.mean(axis=0) * (1 - cars.mean(axis=0))).mean())
    assert ignorant.brier == pytest.approx(ignorant.brier_base)
    assert ignorant.brier_skill == pytest.approx(0)


def test_bins_hold_equal_numbers_of_cells_in_order_of_claim() -> None:
    claims = np.linspace(0.05, 1, 100)[:, None]
    judged = judge(overlay(claims.tolist(), [[1]] * 100), np.ones((100, 1), int), 100, seed=0)
    assert [one.cells for one in judged.bins] == [10] * 10
    assert [one.said for one in judged.bins] == sorted(one.said for one in judged.bins)


def test_claims_below_the_drawing_limit_are_not_judged() -> None:
    judged = judge(overlay([[0.04, 0.05]], [[1, 1]]), np.array([[1, 1]]), 1, seed=0)
    assert judged.drawn == 1
    assert judged.coverage == 0.5
