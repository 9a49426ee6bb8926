"""The tasks by name."""

from collections.abc import Callable
from functools import cache
from typing import Any

from models.envs.api import Environment
from models.envs.parent_child import ParentChild
from models.envs.predator_prey import PredatorPrey
from models.envs.traffic_junction import TrafficJunction

_TASKS: dict[str, Callable[[], Environment[Any]]] = {
    "traffic_junction/easy": lambda: TrafficJunction("easy"),
    "traffic_junction/medium": lambda: TrafficJunction("medium"),
    "traffic_junction/hard": lambda: TrafficJunction("hard"),
    "predator_prey/5x5": lambda: PredatorPrey("5x5"),
    "predator_prey/10x10": lambda: PredatorPrey("10x10"),
    "parent_child": ParentChild,
}

NAMES: tuple[str, ...] = tuple(_TASKS)


class UnknownTaskError(KeyError):
    """No environment has this name."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.name = name

    def __str__(self) -> str:
        return f"unknown task {self.name!r}; known tasks: {', '.join(NAMES)}"


@cache
def make(name: str) -> Environment[Any]:
    """Return the environment of this name; it holds no state, so all callers share it.

    Raises:
        UnknownTaskError: the name is not in `NAMES`.
    """
    if name not in _TASKS:
        raise UnknownTaskError(name)
    return _TASKS[name]()
