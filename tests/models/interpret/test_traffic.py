import numpy as np
import pytest

from models.envs import registry
from models.interpret.estimate import listen
from models.interpret.traffic import traffic
from tests.models.interpret.speakers import Babbler, Honest

MEDIUM = registry.make("traffic_junction/medium")


def test_who_names_its_cell_names_its_lane_but_not_where_it_came_from() -> None:
    policy = Honest(MEDIUM)
    found = traffic(MEDIUM, listen(MEDIUM, policy, 200, 1).turns, policy.tokens, seed=1)
    assert found.lane.bits > 0.9 * found.lane.entropy_bits
    assert found.arrival.bits < 0.75 * found.arrival.entropy_bits
    assert found.common_lanes.tokens == 4  # the cells in which lanes cross
    assert found.common_arrivals.tokens > 20
    assert found.by_lane.sum() == found.along.overall.turns


def test_babble_is_shared_by_all_lanes_and_tells_none() -> None:
    found = traffic(MEDIUM, listen(MEDIUM, Babbler(MEDIUM), 100, 1).turns, Babbler(MEDIUM).tokens, seed=1)
    assert (found.common_lanes.tokens, found.common_lanes.of) == (2, 2)
    assert found.common_lanes.messages == 1
    assert found.lane.bits < 0.02
    assert np.isnan(found.deeds.gas[2:]).all()


def test_who_never_speaks_tells_nothing() -> None:
    policy = Honest(MEDIUM, gate_open=False)
    found = traffic(MEDIUM, listen(MEDIUM, policy, 10, 1).turns, policy.tokens, seed=1)
    assert found.along.overall.mean == 0
    assert found.lane.bits == found.route.bits == 0
    assert found.common_lanes == (0, 0, 0.0)


def test_an_open_gate_speaks_in_every_step_of_the_way() -> None:
    policy = Honest(MEDIUM)
    found = traffic(MEDIUM, listen(MEDIUM, policy, 50, 1).turns, policy.tokens, seed=1)
    assert found.along.entering is not None
    assert found.along.entering.mean == 1
    assert set(found.along.positions) == set(range(15))
    assert found.deeds.gas_overall == pytest.approx(1)
