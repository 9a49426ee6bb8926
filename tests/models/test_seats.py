"""Cars of a seat, counted by hand: one episode, two seats and the participant's, four steps."""

import numpy as np

from models.rollout import Rollout
from models.seats import occupancies


def rollout(alive: list[list[int]], collided: list[list[int]], completed: list[list[int]]) -> Rollout:
    """Rows are states, columns seats; the last state has no row in `alive`."""
    living = np.array(alive, np.bool_)[:, None]  # (T, 1, N)
    nothing = np.zeros(living.shape, np.int32)
    marks = [np.array(rows, np.bool_)[:, None] for rows in (collided, completed)]
    return Rollout(
        nothing, living, nothing, living, nothing, nothing.astype(np.float32), *marks,
        np.array([True]), np.array([len(alive)], np.int32), np.array([3], np.int32), nothing, nothing,
    )  # fmt: skip


NOBODY = [[0, 0, 0]] * 5


def test_a_car_counts_once_however_often_it_meets_others() -> None:
    crash = [[0, 0, 0], [1, 1, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0]]
    found = occupancies(rollout([[1, 1, 1]] * 4, crash, NOBODY))
    assert found.cars.tolist() == [[1, 1, 1]]
    assert found.collided.tolist() == [[1, 1, 0]]


def test_a_seat_that_is_taken_again_at_once_holds_a_second_car() -> None:
    leaves = [[0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0]]
    crash = [[0, 0, 0], [1, 1, 0], [1, 1, 0], [0, 0, 0], [0, 0, 0]]
    found = occupancies(rollout([[1, 1, 1]] * 4, crash, leaves))
    assert found.cars.tolist() == [[2, 1, 1]]
    assert found.collided.tolist() == [[2, 1, 0]]


def test_what_happens_after_the_trial_is_not_counted() -> None:
    ends = [[0, 0, 0], [0, 1, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
    later = [[0, 0, 0], [0, 0, 0], [1, 1, 0], [0, 0, 0], [0, 0, 0]]
    crash = (np.array(ends) | np.array(later)).tolist()
    found = occupancies(rollout([[0, 1, 1], [0, 1, 1], [1, 1, 1], [1, 1, 1]], crash, NOBODY))
    assert found.cars.tolist() == [[0, 1, 1]]
    assert found.collided.tolist() == [[0, 1, 1]]


def test_a_newcomer_that_crashes_in_the_last_state_is_a_car_too() -> None:
    last = [*NOBODY[:4], [1, 1, 0]]
    found = occupancies(rollout([[0, 1, 1]] * 4, last, NOBODY))
    assert found.cars.tolist() == [[1, 1, 1]]
    assert found.collided.tolist() == [[1, 1, 0]]
