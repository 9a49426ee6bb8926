"""How robots play: from the view that a browser gets, and what they remember of earlier rounds, to an action.

`Sensible` learns what signs mean as a person might: where the child was when a sign was sent, and where the
parent went when a sign was chosen. `Careless` picks any action. Neither sees more than the payload.
"""

from collections.abc import Mapping
from random import Random
from typing import Any, Literal, Protocol

View = Mapping[str, Any]
Cell = tuple[int, int]
StyleName = Literal["sensible", "random", "mixed"]

UP, RIGHT, DOWN, LEFT, STAY = range(5)
GO, BRAKE = 0, 1
NEARLY_CERTAIN = 0.2
"""A triangle of this likelihood on the next cell is worth a wait."""
PATIENCE = 4
"""Waits in a row before the robot drives on."""
STEPS_TO_EXPECT = 6.0
"""Mean distance between two cells of the 9 x 9 board: what an unknown sign is worth."""


class Player(Protocol):
    """One robot's mind over its whole session."""

    def decide(self, view: View) -> int:
        """Choose an action for a view that is not over."""
        ...

    def learn(self, view: View) -> None:
        """Take in the view of a round that is over."""
        ...


def player(style: StyleName, seed: str, index: int) -> Player:
    """Make the mind of robot `index`; `mixed` alternates."""
    random = Random(f"{seed}/{index}/play")  # noqa: S311 - play, not secrets
    careless = style == "random" or (style == "mixed" and index % 2 == 1)
    return Careless(random) if careless else Sensible(random)


def choices(view: View) -> list[int]:
    """Give the actions that this view allows."""
    return [int(action) for action in view["actions"]]


class Careless:
    """Any action, each as likely."""

    def __init__(self, random: Random) -> None:
        self._random = random

    def decide(self, view: View) -> int:
        return self._random.choice(choices(view))

    def learn(self, view: View) -> None:
        """Learn nothing."""


class Sensible:
    """Goes where signs pointed before, sweeps otherwise, and waits for likely cars."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._found_at: dict[int, list[Cell]] = {}
        self._led_to: dict[int, list[Cell]] = {}
        self._waited = 0

    def decide(self, view: View) -> int:
        role = view["role"]
        if role == "parent":
            return self._search(view)
        return self._choose(view) if role == "child" else self._drive(view)

    def learn(self, view: View) -> None:
        sign = view.get("sign")
        if sign is None:
            return
        if view["role"] == "parent":
            self._found_at.setdefault(sign, []).append(_cell(view["over"]["child"]))
        elif view["role"] == "child":
            self._led_to.setdefault(sign, []).append(_cell(view["walk"][-1]))

    def _search(self, view: View) -> int:
        own = _cell(view["cell"])
        if view["child"] is not None:
            return towards(own, _cell(view["child"]))
        known = self._found_at.get(view["sign"], []) if view["sign"] is not None else []
        aim = _centre(known) if known else None
        return towards(own, self._next_place(view, own, aim))

    def _next_place(self, view: View, own: Cell, aim: Cell | None) -> Cell:
        """Choose the unseen cell that is near, and near to where this sign pointed before."""
        size, vision = view["size"], view["vision"]
        seen = {cell for at in view["trail"] for cell in _window(_cell(at), vision, size)}
        seen |= set(_window(own, vision, size))
        unseen = [(r, c) for r in range(size) for c in range(size) if (r, c) not in seen]
        if not unseen:
            return (self._random.randrange(size), self._random.randrange(size))
        weight = 0 if aim is None else 3
        return min(unseen, key=lambda cell: (_far(own, cell) + weight * _far(aim or own, cell), cell))

    def _choose(self, view: View) -> int:
        own = _cell(view["cell"])

        def expected(sign: int) -> tuple[float, float]:
            ends = self._led_to.get(sign)
            far = sum(_far(own, end) for end in ends) / len(ends) if ends else STEPS_TO_EXPECT
            return far, self._random.random()

        return min(choices(view), key=expected)

    def _drive(self, view: View) -> int:
        likely = {(row, column): likelihood for row, column, likelihood in view["triangles"]}
        ahead = view["route"][view["position"] + 1 : view["position"] + 2]
        danger = max((likely.get(_cell(cell), 0.0) for cell in ahead), default=0.0)
        if danger >= NEARLY_CERTAIN and self._waited < PATIENCE:
            self._waited += 1
            return BRAKE
        self._waited = 0
        return GO


def towards(own: Cell, goal: Cell) -> int:
    """Choose the move that shortens the longer side of the way.

    >>> towards((4, 4), (2, 5)) == UP
    True
    """
    rows, columns = goal[0] - own[0], goal[1] - own[1]
    if rows == columns == 0:
        return STAY
    if abs(rows) >= abs(columns):
        return DOWN if rows > 0 else UP
    return RIGHT if columns > 0 else LEFT


def _cell(pair: Any) -> Cell:
    return int(pair[0]), int(pair[1])


def _far(one: Cell, other: Cell) -> int:
    return abs(one[0] - other[0]) + abs(one[1] - other[1])


def _centre(cells: list[Cell]) -> Cell:
    return round(sum(r for r, _ in cells) / len(cells)), round(sum(c for _, c in cells) / len(cells))


def _window(at: Cell, vision: int, size: int) -> list[Cell]:
    rows = range(max(0, at[0] - vision), min(size, at[0] + vision + 1))
    columns = range(max(0, at[1] - vision), min(size, at[1] + vision + 1))
    return [(row, column) for row in rows for column in columns]
