"""The rules of Predator-Prey one by one, on scenes set by hand."""

import numpy as np
import pytest

from models.envs.grid import DOWN, LEFT, RIGHT, STAY, UP
from models.envs.predator_prey import PredatorPrey, PredatorPreyState

SMALL, LARGE = PredatorPrey("5x5"), PredatorPrey("10x10")
Cell = tuple[int, int]


def _scene(env: PredatorPrey, *cells: Cell) -> PredatorPreyState:
    """One hunt; the prey last."""
    *predators, prey = (env.dim * row + column for row, column in cells)
    return env.place(np.zeros(1, np.uint64), np.array([predators]), np.array([prey]))


def _go(env: PredatorPrey, state: PredatorPreyState, *actions: int) -> tuple[PredatorPreyState, list[float]]:
    after, reward = env.step(state, np.array([actions], np.int32))
    return after, reward[0].tolist()


def _cells(env: PredatorPrey, state: PredatorPreyState) -> list[Cell]:
    return [divmod(cell, env.dim) for cell in env.cell_of(state)[0].tolist()]


def _paid(*hundredths: float) -> list[float]:
    return pytest.approx([number / 100 for number in hundredths])


def test_the_two_sizes_are_those_of_the_paper() -> None:
    for env, dim, predators, vision, steps in ((SMALL, 5, 3, 0, 20), (LARGE, 10, 5, 1, 40)):
        assert env.shape == (dim, dim)
        assert env.agents == predators + 1
        assert env.steps_max == steps
        assert env.observation_size == (2 * vision + 1) ** 2 * (dim * dim + 4)


@pytest.mark.parametrize(
    ("action", "cell"), [(UP, (1, 2)), (RIGHT, (2, 3)), (DOWN, (3, 2)), (LEFT, (2, 1)), (STAY, (2, 2))]
)
def test_predators_move_in_the_five_ways(action: int, cell: Cell) -> None:
    after, _ = _go(SMALL, _scene(SMALL, (2, 2), (0, 0), (0, 0), (4, 4)), action, STAY, STAY, STAY)

    assert _cells(SMALL, after) == [cell, (0, 0), (0, 0), (4, 4)]


def test_walls_hold_and_predators_pass_through_each_other() -> None:
    after, _ = _go(SMALL, _scene(SMALL, (0, 1), (3, 0), (3, 1), (4, 4)), UP, RIGHT, LEFT, STAY)

    assert _cells(SMALL, after) == [(0, 1), (3, 1), (3, 0), (4, 4)]


def test_who_has_reached_the_prey_stays_whatever_it_does() -> None:
    for action in range(5):
        after, _ = _go(SMALL, _scene(SMALL, (2, 2), (0, 0), (0, 0), (2, 2)), action, STAY, STAY, STAY)
        assert _cells(SMALL, after)[0] == (2, 2)


def test_the_preys_action_is_ignored() -> None:
    for action in range(5):
        after, _ = _go(SMALL, _scene(SMALL, (0, 0), (0, 0), (0, 0), (2, 2)), STAY, STAY, STAY, action)
        assert _cells(SMALL, after)[3] == (2, 2)


def test_each_predator_on_the_prey_makes_it_worth_more_and_the_prey_gets_their_mean() -> None:
    prey, near, far = (2, 2), (2, 1), (0, 0)
    state = _scene(SMALL, far, far, far, prey)
    assert _go(SMALL, state, STAY, STAY, STAY, STAY)[1] == _paid(-5, -5, -5, -5)
    state = _scene(SMALL, near, far, far, prey)
    assert _go(SMALL, state, RIGHT, STAY, STAY, STAY)[1] == _paid(5, -5, -5, -5 / 3)
    state = _scene(SMALL, near, prey, far, prey)
    assert _go(SMALL, state, RIGHT, STAY, STAY, STAY)[1] == _paid(10, 10, -5, 5)
    state = _scene(SMALL, near, prey, prey, prey)
    assert _go(SMALL, state, RIGHT, STAY, STAY, STAY)[1] == _paid(15, 15, 15, 15)


def test_a_hunt_goes_on_to_its_last_step_though_all_have_arrived() -> None:
    state = _scene(SMALL, (2, 2), (2, 2), (2, 2), (2, 2))
    for _ in range(20):
        assert SMALL.success(state).all()
        assert not SMALL.done(state).any()
        state, reward = _go(SMALL, state, UP, UP, UP, UP)
        assert reward == _paid(15, 15, 15, 15)
    assert SMALL.done(state).all()
    assert _go(SMALL, state, UP, UP, UP, UP)[1] == [0, 0, 0, 0]


def test_success_needs_every_predator() -> None:
    assert not SMALL.success(_scene(SMALL, (2, 2), (2, 2), (2, 1), (2, 2)))[0]


def test_everybody_speaks_at_every_step_and_the_prey_is_sought() -> None:
    for env in (SMALL, LARGE):
        assert env.speaks.all()
        assert not env.message_held
        assert env.sought == env.agents - 1


@pytest.mark.parametrize("env", [SMALL, LARGE])
def test_all_begin_on_distinct_uniform_cells(env: PredatorPrey) -> None:
    cell = env.cell_of(env.init(np.arange(40_000, dtype=np.uint64)))

    assert (np.diff(np.sort(cell, axis=1)) > 0).all()
    for seat in range(env.agents):
        shares = np.bincount(cell[:, seat], minlength=env.cells) / 40_000
        assert shares == pytest.approx(1 / env.cells, rel=0.25)


def test_blind_predators_see_their_own_cell_and_count_who_is_in_it() -> None:
    state = _scene(SMALL, (1, 2), (1, 2), (4, 4), (1, 2))
    first, _, lonely, prey = SMALL.observe(state)[0]

    assert {int(i): first[i] for i in np.flatnonzero(first)} == {7: 1, 27: 1, 28: 2}
    assert np.array_equal(first, prey)
    assert {int(i): lonely[i] for i in np.flatnonzero(lonely)} == {24: 1, 28: 1}


def test_a_window_shows_walls_and_numbers_of_predators() -> None:
    state = _scene(LARGE, (0, 0), (1, 1), (1, 1), (1, 1), (9, 9), (0, 1))
    seen = LARGE.observe(state)[0].reshape(6, 3, 3, 104)

    assert seen[0, 0, :, 101].tolist() == seen[0, :, 0, 101].tolist() == [1, 1, 1]
    assert seen[0, 1, 2, 1] == seen[0, 1, 2, 102] == 1  # the prey, to the right
    assert seen[0, 2, 2, 103] == 3
    assert seen[0, 1, 1, 103] == 1
    assert not seen[..., 100].any()


def test_only_the_first_state_has_new_occupants() -> None:
    state = SMALL.init(np.zeros(1, np.uint64))

    assert SMALL.fresh(state).all()
    assert not SMALL.fresh(_go(SMALL, state, STAY, STAY, STAY, STAY)[0]).any()
