"""Who gets which arm: minimisation over arm x role order within a device class, as one pure function.

The cell with the fewest people (finished, or active within their lease) is taken with probability .8, else
any cell with equal probability. Within the device class equal cells are told apart by their total over all
device classes; what is still equal shares the .8. An arm without free places is left out. Everything that the
draw depended on is stored, so that a re-randomisation test can run this very function.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from models import rng

BEST = 0.8
ALLOCATION = 69
"""Stream over the participant's seed: index 0 best or any, 1 which of them."""

Cell = tuple[str, str]
"""Arm and role order."""
Counts = Mapping[tuple[str, str, str], int]
"""People by arm, role order and device class."""


@dataclass(frozen=True, slots=True)
class Allocated:
    arm: str
    role_order: str
    probability: float
    """With which this cell was drawn, given the counts."""


def allocate(
    places: Mapping[str, int], role_orders: Sequence[str], device: str, counts: Counts, seed: int
) -> Allocated | None:
    """Draw a cell, or None where every arm is full. `places` holds every arm's, in the study's order."""
    cells = open_cells(places, role_orders, counts)
    if not cells:
        return None
    best = best_cells(cells, device, counts)
    takes_best = rng.chance(rng.word(seed, ALLOCATION, 0, 0), rng.threshold(BEST))
    drawn_from = best if takes_best else cells
    arm, role_order = drawn_from[rng.below(rng.word(seed, ALLOCATION, 0, 1), len(drawn_from))]
    return Allocated(arm, role_order, probability((arm, role_order), cells, best))


def open_cells(places: Mapping[str, int], role_orders: Sequence[str], counts: Counts) -> list[Cell]:
    return [
        (arm, order)
        for arm, room in places.items()
        for order in role_orders
        if sum(n for (of_arm, _, _), n in counts.items() if of_arm == arm) < room
    ]


def best_cells(cells: Sequence[Cell], device: str, counts: Counts) -> list[Cell]:
    sizes = {cell: size(cell, device, counts) for cell in cells}
    least = min(sizes.values())
    return [cell for cell in cells if sizes[cell] == least]


def size(cell: Cell, device: str, counts: Counts) -> tuple[int, int]:
    """People in the cell: of this device class, and of all."""
    everyone = sum(n for (arm, order, _), n in counts.items() if (arm, order) == cell)
    return counts.get((*cell, device), 0), everyone


def probability(cell: Cell, cells: Sequence[Cell], best: Sequence[Cell]) -> float:
    share = BEST / len(best) if cell in best else 0.0
    return share + (1 - BEST) / len(cells)
