"""Robots send timing values that a browser could have sent."""

import pytest

from server.simulate.timing import Stopwatch
from server.web.schemas import Timing


def test_every_timing_passes_the_servers_own_schema_and_adds_up() -> None:
    stopwatch = Stopwatch("3", 1)
    before = 0.0
    for _ in range(200):
        timing = stopwatch.decision()
        Timing.model_validate(timing)
        assert timing["rt_ms"] == pytest.approx(timing["response_ms"] - timing["onset_ms"], abs=1e-6)
        assert timing["onset_ms"] > before
        before = timing["response_ms"]


def test_only_the_first_decision_waited_for_no_answer() -> None:
    stopwatch = Stopwatch("3", 1)
    assert stopwatch.decision()["wait_ms"] is None
    assert stopwatch.decision()["wait_ms"] > 0


def test_the_same_seed_gives_the_same_times() -> None:
    one, other = Stopwatch("3", 1), Stopwatch("3", 1)
    assert [one.decision() for _ in range(5)] == [other.decision() for _ in range(5)]
    assert Stopwatch("3", 2).decision() != Stopwatch("3", 1).decision()
