"""Convergence: the first of twenty good evaluations in a row."""

import pytest

from models.training.convergence import Converged, Criterion, Unreached, converged


def rows(marks, **more):
    """A log with a success for each mark, every 50 updates and 2,000 steps."""
    return [
        {"total": str(50 * n), "env_steps": str(2000 * n), "success": mark, "message_rate": "1.0", **more}
        for n, mark in enumerate(marks, 1)
    ]


GOOD, BAD = "0.9500", "0.9499"


def test_it_is_where_the_first_long_enough_series_begins():
    marks = [BAD, *[GOOD] * 19, BAD, BAD, *[GOOD] * 25]
    assert converged(rows(marks), Criterion(0.95)) == Converged(50 * 23, 2000 * 23)


@pytest.mark.parametrize("marks", [[], [*[GOOD] * 19, BAD] * 3, ["nan"] * 40, [""] * 40, [GOOD, BAD]])
def test_a_shorter_series_that_broke_off_is_never(marks):
    assert converged(rows(marks), Criterion(0.95)) is Unreached.NEVER


@pytest.mark.parametrize("marks", [[GOOD], [GOOD] * 19, [BAD] * 40 + [GOOD] * 19, [GOOD] * 19 + [BAD, GOOD]])
def test_a_shorter_series_that_held_to_the_end_is_too_short_to_tell(marks):
    assert converged(rows(marks), Criterion(0.95)) is Unreached.TOO_SHORT


def test_exactly_twenty_are_enough():
    assert converged(rows([GOOD] * 20), Criterion(0.95)) == Converged(50, 2000)


@pytest.mark.parametrize(
    ("rate", "reached"), [("0.4800", True), ("0.5200", True), ("0.4799", False), ("0.5201", False)]
)
def test_the_message_rate_must_keep_to_the_budget_from_both_sides(rate, reached):
    log = rows([GOOD] * 20, message_rate=rate)
    found = converged(log, Criterion(0.95, rate=0.5, tolerance=0.02))
    assert found == (Converged(50, 2000) if reached else Unreached.NEVER)


def test_any_column_can_be_the_measure():
    log = rows([BAD] * 20, reward="2.41")
    assert converged(log, Criterion(2.4, column="reward")) == Converged(50, 2000)
    assert converged(log, Criterion(2.42, column="reward")) is Unreached.NEVER
