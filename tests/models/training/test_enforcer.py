"""The Enforcer against the paper's formula, written out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.training.enforcer import Enforcer, proportional, silence


@pytest.mark.parametrize(
    ("share", "budget", "expected"),
    [
        (0.5, 0.5, 0.0),
        (0.0, 0.5, 1.0),
        (1.0, 0.5, -1.0),
        (0.15, 0.3, 0.5),
        (0.65, 0.3, -0.5),
        (0.7, 1.0, 0.3),
        (1.0, 1.0, 0.0),
    ],
)
def test_the_proportional_part_is_the_papers(share, budget, expected):
    assert proportional(np.array([share]), budget)[0] == pytest.approx(expected)


def test_the_penalty_over_three_updates_is_the_papers():
    enforcer = Enforcer(0.5)
    first = np.array([1.0, 0.5])  # R_P = -1, 0
    np.testing.assert_allclose(enforcer.penalty(first), [0.1 * (1 + 1.6), 0.0])
    enforcer = enforcer.after(first)  # mean R_P -0.5, sum -0.5
    second = np.array([0.75])  # R_P = -0.5, unchanged on the mean
    np.testing.assert_allclose(enforcer.penalty(second), [0.1 * abs(-0.5 + 0 + 0.026 * -0.5)])
    enforcer = enforcer.after(second)  # sum -1.0
    np.testing.assert_allclose(enforcer.penalty(np.array([0.5])), [0.1 * abs(0 + 1.6 * 0.5 + 0.026 * -1.0)])


def test_the_sum_of_errors_stays_within_its_bound():
    enforcer = Enforcer(0.5)
    for _ in range(200):
        enforcer = enforcer.after(np.ones(3))
    assert enforcer.total == -50


@given(st.floats(0, 1), st.floats(0.05, 0.95))
def test_nothing_is_ever_paid_for_missing_the_budget(share, budget):
    penalty = Enforcer(budget).penalty(np.array([share]))[0]
    assert penalty >= 0
    assert (penalty == 0) == (share == budget) or abs(share - budget) < 1e-12


def test_silence_costs_and_talking_does_not():
    np.testing.assert_allclose(silence(np.array([0.0, 0.25, 1.0])), [0.1, 0.075, 0.0])
