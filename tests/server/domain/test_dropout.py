"""Dropouts do not unbalance the arms: whole studies are simulated, with the allocation that people get.

People arrive as places are free, and stay for a while; a fifth of them drop out, their device being counted.
Within each device class the finished people of every arm must stay within two of an equal share.
"""

from collections import Counter
from collections.abc import Iterator
from random import Random

import pytest

from server.domain.allocation import allocate
from server.domain.study import StudyDefinition
from tests.fakes import definition

STUDIES = 1_000
DROPOUT = 0.2
DEVICES = {"desktop": 0.85, "tablet": 0.1, "unknown": 0.05}
AT_ONCE = 40
STAY = (5, 40)
"""Time steps that somebody stays, whether to the end or not."""

Cell = tuple[str, str, str]


def finished_people(study: StudyDefinition, random: Random) -> Counter[Cell]:
    """Run one study until every place is finished; who finished, by arm, role order and device class."""
    places = {arm.name: arm.places for arm in study.arms}
    holding: Counter[Cell] = Counter()
    finished: Counter[Cell] = Counter()
    inside: list[tuple[int, bool, Cell]] = []
    now = 0
    while finished.total() < study.places:
        now += 1
        inside += [
            (now + random.randint(*STAY), random.random() >= DROPOUT, cell)
            for cell in newcomers(study, places, holding, AT_ONCE - len(inside), random)
        ]
        for _, stays, cell in (each for each in inside if each[0] <= now):
            (finished if stays else Counter[Cell]())[cell] += 1
            holding[cell] -= not stays
        inside = [each for each in inside if each[0] > now]
    return finished


def newcomers(
    study: StudyDefinition, places: dict[str, int], holding: Counter[Cell], most: int, random: Random
) -> Iterator[Cell]:
    """Those who come in now; each holds a place at once."""
    for _ in range(most):
        device = random.choices(list(DEVICES), list(DEVICES.values()))[0]
        drawn = allocate(places, study.role_orders, device, holding, random.getrandbits(53))
        if drawn is None:
            return
        cell = (drawn.arm, drawn.role_order, device)
        holding[cell] += 1
        yield cell


def is_balanced(study: StudyDefinition, finished: Counter[Cell]) -> bool:
    for device in DEVICES:
        people = [
            sum(n for (arm, _, where), n in finished.items() if (arm, where) == (each.name, device))
            for each in study.arms
        ]
        equal = sum(people) / len(people)
        if any(abs(number - equal) > 2 for number in people):
            return False
    return True


@pytest.mark.parametrize("slug", ["traffic-junction", "parent-child"])
def test_arms_stay_within_two_of_an_equal_share_in_every_device_class(slug: str) -> None:
    study, random = definition(slug), Random(slug)
    balanced = sum(is_balanced(study, finished_people(study, random)) for _ in range(STUDIES))
    assert balanced >= 0.95 * STUDIES


def test_drawing_without_looking_would_not() -> None:
    """The measure tells: with arms drawn evenly at random far fewer studies are balanced."""
    study, random = definition("traffic-junction"), Random(1)
    arms = [arm.name for arm in study.arms]

    def drawn() -> Counter[Cell]:
        people = range(study.places)
        devices = random.choices(list(DEVICES), list(DEVICES.values()), k=len(people))
        return Counter((random.choice(arms), "driver", device) for device in devices)

    assert sum(is_balanced(study, drawn()) for _ in range(200)) < 100
