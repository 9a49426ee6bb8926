import numpy as np
import pytest

from models.interpret.shared import entropy, groups, pair, shared


def test_a_copy_tells_everything_and_a_constant_nothing() -> None:
    labels = np.repeat(np.arange(8), 500)
    assert shared(labels, labels).bits == pytest.approx(3, abs=0.01)
    assert shared(np.zeros_like(labels), labels).bits == pytest.approx(0, abs=1e-9)
    assert shared(labels, labels).entropy_bits == pytest.approx(3, abs=0.01)


def test_half_of_the_bits_are_told_by_half_of_the_name() -> None:
    labels = np.tile(np.arange(16), 400)
    assert shared(labels // 4, labels).plugin_bits == pytest.approx(2)


def test_the_correction_takes_off_what_chance_alone_would_tell() -> None:
    rng = np.random.default_rng(0)
    plugin, corrected = [], []
    for _ in range(40):
        found = shared(rng.integers(0, 20, 2_000), rng.integers(0, 10, 2_000))
        plugin.append(found.plugin_bits)
        corrected.append(found.bits)
    assert np.mean(plugin) == pytest.approx(19 * 9 / (2 * 2_000 * np.log(2)), rel=0.1)
    assert np.mean(corrected) < 0.15 * np.mean(plugin)


def test_nothing_has_no_entropy() -> None:
    assert entropy(np.zeros(0, np.int64)).bits == 0
    assert shared(np.zeros(0, np.int64), np.zeros(0, np.int64)).bits == 0


def test_pairs_of_labels_stay_apart() -> None:
    x, y = np.repeat(np.arange(-1, 4), 6), np.tile(np.arange(-1, 5), 5)
    assert len(np.unique(pair(x, y))) == 30


def test_a_group_that_has_less_than_a_tenth_of_the_use_is_no_home() -> None:
    tokens = np.array([0] * 100 + [1] * 100)
    group = np.array([0] * 91 + [1] * 9 + [0] * 90 + [1] * 10)
    assert groups(tokens, group, 3).tolist() == [1, 2, 0]
