import numpy as np
import pytest

from models.interpret.along import along
from tests.models.interpret.tables import turns


def test_rates_are_messages_per_turn_at_each_place() -> None:
    found = along(turns(6, position=[0, 0, 1, 1, 1, 3], sent=[1, 1, 1, 0, 0, 0]), seed=0)
    assert {place: (rate.mean, rate.turns) for place, rate in found.positions.items()} == {
        0: (1.0, 2),
        1: (pytest.approx(1 / 3), 3),
        3: (0.0, 1),
    }
    assert found.overall.mean == 0.5
    assert found.entering is None


def test_who_has_just_appeared_is_counted_apart_from_who_waits_at_the_entrance() -> None:
    found = along(turns(4, entered=[True, False, False, False], sent=[1, 0, 0, 0]), seed=0)
    assert found.entering is not None
    assert (found.entering.mean, found.entering.turns) == (1.0, 1)
    assert found.positions[0].mean == 0.25


def test_intervals_resample_trials_and_not_turns() -> None:
    # 40 trials of 100 turns each: half of the trials talk all the time, the others never
    episode = np.repeat(np.arange(40), 100)
    low, high = along(turns(4_000, episode=episode, sent=episode < 20), seed=1).overall.ci95
    assert high - low == pytest.approx(2 * 1.96 * 0.5 / np.sqrt(40), rel=0.15)
