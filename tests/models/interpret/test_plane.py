import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from models.interpret.plane import APART_PX, MARGIN_PX, PLANE_PX, drawn, principal


def px(points: np.ndarray) -> np.ndarray:
    return drawn(points) * np.array(PLANE_PX)


def gaps(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, None] - points[None], axis=2)[np.triu_indices(len(points), 1)]


def test_components_are_those_of_the_covariance() -> None:
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(40, 5)) * [5, 3, 1, 0.5, 0.1]
    found = principal(vectors, np.ones(40, bool))
    spectrum = np.sort(np.linalg.eigvalsh(np.cov(vectors.T)))[::-1]
    assert np.allclose(found.coordinates.var(axis=0, ddof=1), spectrum[:2])
    assert np.allclose(found.explained, spectrum[:2] / spectrum.sum())


def test_the_largest_loading_of_each_axis_is_positive() -> None:
    rng = np.random.default_rng(1)
    vectors = rng.normal(size=(9, 4))
    for flip in np.array([[1, 1, 1, 1], [-1, 1, -1, 1], [-1, -1, -1, -1]]):
        found = principal(vectors * flip, np.ones(9, bool))
        centred = vectors * flip - (vectors * flip).mean(axis=0)
        loadings = np.linalg.lstsq(centred, found.coordinates, rcond=None)[0]  # (D, 2)
        assert all(column[np.abs(column).argmax()] > 0 for column in loadings.T)


def test_vectors_nobody_sends_do_not_turn_the_plane() -> None:
    rng = np.random.default_rng(2)
    vectors = rng.normal(size=(9, 4))
    used = np.array([True] * 7 + [False] * 2)
    moved = vectors.copy()
    moved[~used] *= 100
    one, other = principal(vectors, used), principal(moved, used)
    assert np.allclose(one.coordinates[used], other.coordinates[used])


def test_one_hot_vectors_stand_on_a_circle_whose_axes_explain_equal_shares() -> None:
    found = principal(np.eye(9), np.ones(9, bool))
    assert np.allclose(np.linalg.norm(found.coordinates, axis=1), 1)
    assert np.allclose(found.explained, 1 / 8)


def test_few_tokens_or_dimensions_still_have_a_place() -> None:
    assert principal(np.ones((1, 3)), np.ones(1, bool)).coordinates.shape == (1, 2)
    assert principal(np.array([[0.0], [1.0], [5.0]]), np.ones(3, bool)).coordinates.shape == (3, 2)


def test_points_far_apart_keep_one_scale_and_only_turn_upside_down() -> None:
    points = np.array([[0.0, 0], [10, 0], [10, 4], [0, 4], [5, 2]])
    placed = px(points)
    scale = (placed[1, 0] - placed[0, 0]) / 10
    assert np.allclose(placed[0] - placed[2], [-10 * scale, 4 * scale])
    assert np.isclose(placed[:, 0].min(), MARGIN_PX)


@settings(deadline=None, max_examples=60)
@given(arrays(np.float64, (9, 2), elements=st.floats(-3, 3, width=16)))
def test_nine_tokens_always_get_room_to_be_told_apart(points: np.ndarray) -> None:
    placed = px(points)
    assert gaps(placed).min() >= APART_PX
    assert (placed >= MARGIN_PX - 1e-6).all()
    assert (placed <= np.array(PLANE_PX) - MARGIN_PX + 1e-6).all()
    assert np.array_equal(placed, px(points))


def test_nine_tokens_at_one_place_are_spread() -> None:
    assert gaps(px(np.zeros((9, 2)))).min() >= APART_PX


def test_two_near_tokens_move_along_their_line_by_what_is_missing() -> None:
    points = np.array([[0.0, 0], [100, 0], [50, 40], [50, 41]])
    placed = px(points)
    near = placed[3] - placed[2]
    assert np.isclose(np.linalg.norm(near), APART_PX, atol=1e-3)
    assert np.isclose(near[0], 0, atol=1e-6)
