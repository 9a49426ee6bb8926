import numpy as np
import pytest

from models.interpret.deeds import deeds
from tests.models.interpret.tables import turns

RNG = np.random.default_rng(0)


def test_a_token_for_each_action_tells_it() -> None:
    action = RNG.integers(0, 2, 2_000)
    found = deeds(turns(2_000, token=action, action=action), tokens=3)
    assert found.token.bits == pytest.approx(found.token.entropy_bits, abs=1e-3)
    assert found.gas[:2].tolist() == [1.0, 0.0]
    assert np.isnan(found.gas[2])
    assert found.cell.bits == pytest.approx(0, abs=1e-3)
    assert found.beyond_cell_bits == pytest.approx(1, abs=0.01)


def test_a_token_that_only_names_the_cell_adds_nothing_to_it() -> None:
    cell = RNG.integers(0, 4, 4_000)
    found = deeds(turns(4_000, token=cell, cell=cell, action=cell < 2), tokens=4)
    assert found.token.bits == pytest.approx(found.cell.bits)
    assert found.token.bits > 0.9
    assert found.beyond_cell_bits == pytest.approx(0, abs=1e-9)


def test_silence_tells_nothing() -> None:
    found = deeds(turns(0), tokens=2)
    assert np.isnan(found.gas_overall)
    assert found.token.bits == 0
