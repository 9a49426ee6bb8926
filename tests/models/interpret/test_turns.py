import numpy as np

from models.envs import registry
from models.interpret.estimate import ESTIMATION, hearable, listen, lives
from models.interpret.turns import chances, turns
from models.rollout import trials
from tests.models.interpret.speakers import Honest
from tests.models.policies.bundles import tiny_policy

MEDIUM = registry.make("traffic_junction/medium")


def test_a_silent_car_still_has_its_turns() -> None:
    loud = listen(MEDIUM, Honest(MEDIUM), 20, 3).turns
    silent = listen(MEDIUM, Honest(MEDIUM, gate_open=False), 20, 3).turns
    assert loud.sent.all()
    assert not silent.sent.any()
    assert np.array_equal(loud.cell, silent.cell)


def test_the_participant_has_no_turn_and_nobody_has_one_after_the_trial() -> None:
    rollout = next(lives(MEDIUM, Honest(MEDIUM), 30, 3, ESTIMATION))
    turn = chances(MEDIUM, rollout)
    assert not turn[..., -1].any()
    for episode, steps in enumerate(trials(rollout).steps):
        assert not turn[steps:, episode].any()
    assert np.array_equal(hearable(MEDIUM, rollout), turn & rollout.gates)


def test_a_turn_knows_the_place_on_the_route() -> None:
    said = listen(MEDIUM, Honest(MEDIUM), 30, 3).turns
    assert np.array_equal(MEDIUM.route_cells[said.route, said.position], said.cell)


def test_a_car_enters_once_and_where_it_enters() -> None:
    rollout = next(lives(MEDIUM, Honest(MEDIUM), 60, 3, ESTIMATION))
    said = turns(MEDIUM, rollout)
    assert said.entered.sum() > 10
    assert (said.position[said.entered] == 0).all()
    assert np.isin(said.cell[said.entered], MEDIUM.entry_cells).all()
    # honest drivers never wait at the entrance, so whoever is seen there has just appeared
    after_the_first_step = np.nonzero(chances(MEDIUM, rollout))[0] > 0
    assert np.array_equal(said.entered, (said.position == 0) & after_the_first_step)


def test_episodes_are_numbered_across_batches() -> None:
    said = listen(MEDIUM, Honest(MEDIUM), 501, 3).turns
    assert said.episode.max() == 500


def test_a_held_message_is_one_turn_and_has_no_route() -> None:
    said = listen(registry.make("parent_child"), tiny_policy(), 50, 1).turns
    assert len(said.token) == 50
    assert set(said.route.tolist()) == set(said.position.tolist()) == {-1}
    assert not said.entered.any()
