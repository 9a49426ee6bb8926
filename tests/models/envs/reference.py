"""All tasks once more, straight from their rules: one episode, plain Python, no numpy.

Slow and obvious on purpose; the batched environments must agree with it in every number.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from models import rng

Route = list[tuple[int, int]]


def _line(row: int, column: int, down: int, right: int, length: int) -> Route:
    return [(row + down * i, column + right * i) for i in range(length)]


EASY: list[list[Route]] = [[_line(0, 3, 1, 0, 7)], [_line(3, 0, 0, 1, 7)]]

MEDIUM: list[list[Route]] = [  # straight, right, left
    [  # from the top, down column 6
        _line(0, 6, 1, 0, 14),
        _line(0, 6, 1, 0, 7) + _line(6, 5, 0, -1, 6),
        _line(0, 6, 1, 0, 8) + _line(7, 7, 0, 1, 7),
    ],
    [  # from the bottom, up column 7
        _line(13, 7, -1, 0, 14),
        _line(13, 7, -1, 0, 7) + _line(7, 8, 0, 1, 6),
        _line(13, 7, -1, 0, 8) + _line(6, 6, 0, -1, 7),
    ],
    [  # from the left, along row 7
        _line(7, 0, 0, 1, 14),
        _line(7, 0, 0, 1, 7) + _line(8, 6, 1, 0, 6),
        _line(7, 0, 0, 1, 8) + _line(6, 7, -1, 0, 7),
    ],
    [  # from the right, along row 6
        _line(6, 13, 0, -1, 14),
        _line(6, 13, 0, -1, 7) + _line(5, 7, -1, 0, 6),
        _line(6, 13, 0, -1, 8) + _line(7, 6, 1, 0, 7),
    ],
]


@dataclass
class Car:
    route: int
    path: Route
    position: int = 0
    age: int = 0
    last_action: int = 0
    collided: bool = False

    @property
    def cell(self) -> tuple[int, int]:
        return self.path[self.position]


@dataclass
class Frame:
    """What one step of traffic gave, per slot."""

    cars: list[Car | None]
    reward: list[float]
    completed: list[bool]
    crashed: bool


def traffic(
    arrivals: list[list[Route]], slots: int, p: float, seed: int, actions: list[list[int]]
) -> Iterator[Frame]:
    """Yield one frame per row of actions; the frame's cars change with the next step."""
    cars: list[Car | None] = [None] * slots
    crashed = False
    for step, row in enumerate(actions, start=1):
        completed = [False] * slots
        for slot, car in enumerate(cars):
            if car is None:
                continue
            car.age += 1
            car.last_action = row[slot]
            if row[slot] == 0:
                car.position += 1
                if car.position == len(car.path):
                    cars[slot] = None
                    completed[slot] = True
        for entrance, routes in enumerate(arrivals):
            empty = [slot for slot in range(slots) if cars[slot] is None]
            if not empty:
                break
            if rng.word(seed, 1, step, 3 * entrance) / 2**64 < p:
                slot = empty[rng.below(rng.word(seed, 1, step, 3 * entrance + 1), len(empty))]
                turn = rng.below(rng.word(seed, 1, step, 3 * entrance + 2), len(routes))
                cars[slot] = Car(route=sum(map(len, arrivals[:entrance])) + turn, path=routes[turn])
        cells = [car.cell for car in cars if car is not None]
        reward = [0.0] * slots
        for slot, car in enumerate(cars):
            if car is None:
                continue
            hit = cells.count(car.cell) > 1
            car.collided = car.collided or hit
            crashed = crashed or hit
            reward[slot] = -0.01 * car.age - (10 if hit else 0)
        yield Frame(cars, reward, completed, crashed)


@dataclass
class Search:
    """Parent & Lost Child at one moment."""

    parent: tuple[int, int]
    child: tuple[int, int]
    steps: int = 0
    reward: float = 0.0

    @property
    def over(self) -> bool:
        return self.parent == self.child or self.steps == 20

    def window(self, seat: int) -> list[dict[int, int]]:
        """Return what a seat sees: for each cell of its window the non-zero entries of 85."""
        row, column = (self.parent, self.child)[seat]
        cells = []
        for r in (row - 1, row, row + 1):
            for c in (column - 1, column, column + 1):
                inside = 0 <= r <= 8 and 0 <= c <= 8
                entries = {9 * r + c: 1} if inside else {82: 1}
                if (r, c) == self.child:
                    entries[83] = 1
                if (r, c) == self.parent:
                    entries[84] = 1
                cells.append(entries)
        return cells


def search(seed: int) -> Search:
    """Return the beginning of an episode: the child anywhere but on the parent."""
    every = [(row, column) for row in range(9) for column in range(9)]
    parent = every[rng.below(rng.word(seed, 2, 0, 0), 81)]
    free = [cell for cell in every if cell != parent]
    return Search(parent, free[rng.below(rng.word(seed, 2, 0, 1), 80)])


def move(state: Search, action: int) -> Search:
    """Return the state after the parent went up, right, down, left or stayed."""
    if state.over:
        return Search(state.parent, state.child, state.steps, 0.0)
    parent = _walked(state.parent, action, side=9)
    return Search(parent, state.child, state.steps + 1, 0.05 if parent == state.child else -0.05)


def _walked(cell: tuple[int, int], action: int, side: int) -> tuple[int, int]:
    row, column = cell
    if action == 0 and row > 0:
        row -= 1
    elif action == 1 and column < side - 1:
        column += 1
    elif action == 2 and row < side - 1:
        row += 1
    elif action == 3 and column > 0:
        column -= 1
    return row, column


@dataclass
class Hunt:
    """Predator-Prey at one moment."""

    side: int
    vision: int
    predators: list[tuple[int, int]]
    prey: tuple[int, int]

    @property
    def caught(self) -> bool:
        return all(cell == self.prey for cell in self.predators)

    def rewards(self) -> list[float]:
        """Return what being here pays each predator, and the prey last."""
        together = sum(cell == self.prey for cell in self.predators)
        each = [0.05 * together if cell == self.prey else -0.05 for cell in self.predators]
        return [*each, sum(each) / len(each)]

    def window(self, seat: int) -> list[dict[int, int]]:
        """Return what a seat sees: for each cell of its window the non-zero entries of side * side + 4."""
        row, column = [*self.predators, self.prey][seat]
        cells = []
        for r in range(row - self.vision, row + self.vision + 1):
            for c in range(column - self.vision, column + self.vision + 1):
                inside = 0 <= r < self.side and 0 <= c < self.side
                entries = {self.side * r + c: 1} if inside else {self.side**2 + 1: 1}
                if (r, c) == self.prey:
                    entries[self.side**2 + 2] = 1
                if (r, c) in self.predators:
                    entries[self.side**2 + 3] = self.predators.count((r, c))
                cells.append(entries)
        return cells


def hunt(side: int, predators: int, vision: int, seed: int) -> Hunt:
    """Return the beginning of an episode: each seat, the prey last, anywhere but on those before it."""
    free = [(row, column) for row in range(side) for column in range(side)]
    seats = range(predators + 1)
    *hunters, prey = [free.pop(rng.below(rng.word(seed, 4, 0, seat), len(free))) for seat in seats]
    return Hunt(side, vision, hunters, prey)


def chase(before: Hunt, actions: list[int]) -> Hunt:
    """Return the state after every predator that is not on the prey went its way."""
    after = [
        cell if cell == before.prey else _walked(cell, action, before.side)
        for cell, action in zip(before.predators, actions, strict=False)
    ]
    return Hunt(before.side, before.vision, after, before.prey)
