from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.domain.allocation import ALLOCATION, BEST, allocate, best_cells, open_cells, size

ARMS = {"a": 1_000, "b": 1_000, "c": 1_000}
ORDERS = ("x-y", "y-x")
DEVICES = ("desktop", "tablet", "phone")
COUNTS = st.dictionaries(
    st.tuples(st.sampled_from(list(ARMS)), st.sampled_from(ORDERS), st.sampled_from(DEVICES)),
    st.integers(0, 30),
)
SEEDS = st.integers(0, 2**53 - 1)


def enrolled(
    people: int, first_seed: int, devices: tuple[str, ...] = DEVICES
) -> Counter[tuple[str, str, str]]:
    counts: Counter[tuple[str, str, str]] = Counter()
    for index in range(people):
        device = devices[index * 7 % len(devices)]
        drawn = allocate(ARMS, ORDERS, device, counts, first_seed + index)
        assert drawn is not None
        counts[drawn.arm, drawn.role_order, device] += 1
    return counts


@given(COUNTS, SEEDS, st.sampled_from(DEVICES))
def test_the_same_seed_and_counts_draw_the_same_cell(
    counts: dict[tuple[str, str, str], int], seed: int, device: str
) -> None:
    assert allocate(ARMS, ORDERS, device, counts, seed) == allocate(ARMS, ORDERS, device, dict(counts), seed)


@given(COUNTS, st.sampled_from(DEVICES))
def test_the_stored_probabilities_of_all_cells_sum_to_one(
    counts: dict[tuple[str, str, str], int], device: str
) -> None:
    cells = open_cells(ARMS, ORDERS, counts)
    seen = {}
    for seed in range(400):
        drawn = allocate(ARMS, ORDERS, device, counts, seed)
        assert drawn is not None
        seen[drawn.arm, drawn.role_order] = drawn.probability
    best = best_cells(cells, device, counts)
    rest = (1 - BEST) / len(cells)
    expected = {cell: rest + (BEST / len(best) if cell in best else 0) for cell in cells}
    assert sum(expected.values()) == pytest.approx(1)
    assert all(seen[cell] == pytest.approx(expected[cell]) for cell in seen)


def test_cells_come_as_often_as_their_stored_probability_says() -> None:
    counts = {("a", "x-y", "desktop"): 3, ("b", "x-y", "desktop"): 1}
    draws = Counter()
    told = {}
    for seed in range(20_000):
        drawn = allocate(ARMS, ORDERS, "desktop", counts, seed)
        assert drawn is not None
        draws[drawn.arm, drawn.role_order] += 1
        told[drawn.arm, drawn.role_order] = drawn.probability
    assert sum(told.values()) == pytest.approx(1)
    for cell, probability in told.items():
        assert draws[cell] / 20_000 == pytest.approx(probability, abs=0.015)


@given(COUNTS, st.sampled_from(DEVICES))
def test_the_best_cell_has_the_fewest_people_of_this_device_class(
    counts: dict[tuple[str, str, str], int], device: str
) -> None:
    cells = open_cells(ARMS, ORDERS, counts)
    least = min(counts.get((*cell, device), 0) for cell in cells)
    for cell in best_cells(cells, device, counts):
        assert counts.get((*cell, device), 0) == least
        assert size(cell, device, counts) == min(size(other, device, counts) for other in cells)


@given(SEEDS)
def test_arms_and_role_orders_stay_balanced_within_each_device_class(first_seed: int) -> None:
    counts = enrolled(180, first_seed)
    for device in DEVICES:
        cells = [counts[arm, order, device] for arm in ARMS for order in ORDERS]
        assert (
            max(cells) - min(cells) <= 7
        )  # 10 each on average; without minimisation ± 3 standard errors are ± 9


def test_a_full_arm_is_left_out_and_when_all_are_full_nobody_is_drawn() -> None:
    counts = {("a", "x-y", "desktop"): 2, ("a", "y-x", "phone"): 1}
    places = {"a": 3, "b": 1}
    for seed in range(50):
        drawn = allocate(places, ORDERS, "desktop", counts, seed)
        assert drawn is not None
        assert drawn.arm == "b"
    assert allocate(places, ORDERS, "desktop", counts | {("b", "y-x", "phone"): 1}, 1) is None


def test_the_stream_is_named_once() -> None:
    from server.domain import plan

    streams = [value for name, value in vars(plan).items() if name.isupper() and isinstance(value, int)]
    assert ALLOCATION not in streams
