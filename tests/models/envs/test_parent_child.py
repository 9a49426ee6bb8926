"""The rules of Parent & Lost Child one by one, on scenes set by hand."""

import numpy as np
import pytest

from models.envs.grid import DOWN, LEFT, RIGHT, STAY, UP
from models.envs.parent_child import ParentChild, ParentChildState

ENV = ParentChild()


def _scene(parent: tuple[int, int], child: tuple[int, int]) -> ParentChildState:
    cells = (np.array([9 * row + column], np.int32) for row, column in (parent, child))
    return ENV.place(np.zeros(1, np.uint64), *cells)


def _go(state: ParentChildState, action: int, child: int = STAY) -> tuple[ParentChildState, np.ndarray]:
    return ENV.step(state, np.array([[action, child]], np.int32))


@pytest.mark.parametrize(
    ("action", "cell"), [(UP, (3, 4)), (RIGHT, (4, 5)), (DOWN, (5, 4)), (LEFT, (4, 3)), (STAY, (4, 4))]
)
def test_the_parent_moves_in_the_five_ways(action: int, cell: tuple[int, int]) -> None:
    after, _ = _go(_scene((4, 4), (0, 0)), action)

    assert ENV.cell_of(after)[0].tolist() == [9 * cell[0] + cell[1], 0]


def test_a_move_into_the_wall_costs_a_step() -> None:
    after, reward = _go(_scene((0, 4), (8, 8)), UP)

    assert ENV.cell_of(after)[0, 0] == 4
    assert ENV.steps(after)[0] == 1
    assert reward[0].tolist() == [np.float32(-0.05)] * 2


def test_the_childs_action_is_ignored() -> None:
    for child in range(5):
        assert ENV.cell_of(_go(_scene((4, 4), (2, 2)), STAY, child)[0])[0, 1] == 2 * 9 + 2


def test_finding_the_child_ends_the_episode() -> None:
    found, reward = _go(_scene((4, 4), (4, 5)), RIGHT)
    later, nothing = _go(found, LEFT)

    assert ENV.success(found)[0]
    assert ENV.done(found)[0]
    assert reward[0].tolist() == [np.float32(0.05)] * 2
    assert ENV.steps(later)[0] == 1
    assert nothing.tolist() == [[0, 0]]


def test_a_child_that_is_not_found_counts_twenty_steps() -> None:
    state = _scene((4, 4), (8, 8))
    for _ in range(25):
        state, _ = _go(state, STAY)

    assert ENV.steps(state)[0] == 20
    assert ENV.done(state)[0]
    assert not ENV.success(state)[0]


def test_only_the_child_speaks_and_its_word_stands_for_the_episode() -> None:
    assert ENV.speaks.tolist() == [False, True]
    assert ENV.message_held


def test_both_begin_on_distinct_uniform_cells() -> None:
    state = ENV.init(np.arange(40_000, dtype=np.uint64))
    cell = ENV.cell_of(state)

    assert (cell[:, 0] != cell[:, 1]).all()
    for seat in (0, 1):
        assert np.bincount(cell[:, seat], minlength=81) / 40_000 == pytest.approx(1 / 81, rel=0.25)


def test_the_mean_distance_between_the_two_is_six() -> None:
    state = ENV.init(np.arange(40_000, dtype=np.uint64))
    rows, columns = state.parent_row - state.child_row, state.parent_col - state.child_col

    assert (abs(rows) + abs(columns)).mean() == pytest.approx(6.0, abs=0.05)


def test_a_window_shows_cells_walls_and_who_is_there() -> None:
    seen = ENV.observe(_scene((0, 0), (1, 1)))[0].reshape(2, 3, 3, 85)
    parent, child = seen

    assert ENV.observation_size == 765
    assert parent[0, :, 82].tolist() == [1, 1, 1]  # above the grid
    assert parent[:, 0, 82].tolist() == [1, 1, 1]  # left of it
    assert parent[1, 1, 0] == parent[1, 1, 84] == 1  # itself
    assert parent[2, 2, 10] == parent[2, 2, 83] == 1  # the child on (1, 1)
    assert child[0, 0, 0] == child[0, 0, 84] == 1
    assert not child[..., 82].any()
    assert not seen[..., 81].any()


def test_only_the_first_state_has_new_occupants() -> None:
    state = ENV.init(np.zeros(1, np.uint64))

    assert ENV.fresh(state).all()
    assert not ENV.fresh(_go(state, STAY)[0]).any()
