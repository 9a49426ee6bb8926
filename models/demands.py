"""What an agent has to show before it is released: by task, a number of its own evaluation and its limits.

A study measures people; an agent that crashes, or talks more than its budget, would be measured instead.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


@dataclass(frozen=True, slots=True)
class Demand:
    """One limit. Of `least`, `most`, `near` and `above` those that are given must hold."""

    row: str
    """Of the evaluation; a demand on a row that the task does not have is void."""
    measure: str
    least: float | None = None
    most: float | None = None
    near: str | None = None
    """A fact of the agent (`budget`, `tokens`) that it may differ from by `tolerance`."""
    tolerance: float = 0.0
    above: str | None = None
    """A row whose interval must lie below that of this one."""

    def complaint(self, rows: Mapping[str, Any], facts: Mapping[str, float]) -> str | None:
        """What is wrong, in words; None if nothing is."""
        if self.row not in rows:
            return None
        found = rows[self.row][self.measure]
        value, said = found["mean"], f"{self.measure} ({self.row}) is {found['mean']:.3f}"
        if self.least is not None and value < self.least:
            return f"{said}, at least {self.least:g} is needed"
        if self.most is not None and value > self.most:
            return f"{said}, at most {self.most:g} is allowed"
        if self.near is not None and abs(value - facts[self.near]) > self.tolerance:
            return f"{said}, {self.near} {facts[self.near]:g} is missed by more than {self.tolerance:g}"
        if self.above is not None and found["ci95"][0] <= rows[self.above][self.measure]["ci95"][1]:
            return f"{said}, no better than {self.above} ({rows[self.above][self.measure]['mean']:.3f})"
        return None


RATE = 0.03  # of the message rate from the budget, at p = .05 and in human trials

DEMANDS: dict[str, tuple[Demand, ...]] = {
    "traffic_junction": (
        Demand("as_trained", "success", least=0.95, above="masked"),
        Demand("as_trained", "message_rate", near="budget", tolerance=RATE),
        Demand("human", "message_rate", near="budget", tolerance=RATE),
        Demand("human", "arrived", least=0.95),
    ),
    "parent_child": (
        Demand("as_trained", "found", least=0.99),
        Demand("as_trained", "steps", most=7.0),
        Demand("as_trained", "tokens_used", near="tokens"),
    ),
    "predator_prey/5x5": (Demand("as_trained", "reward", least=2.25),),
    "predator_prey/10x10": (Demand("as_trained", "reward", least=7.64),),
}
"""By task, or by its folder for all sizes. The rewards are those of the paper's best method."""


def complaints(task: str, rows: Mapping[str, Any], facts: Mapping[str, float]) -> Sequence[str]:
    """Everything that an evaluation lacks."""
    demands = DEMANDS.get(task) or DEMANDS.get(task.split("/", maxsplit=1)[0], ())
    return [wrong for demand in demands if (wrong := demand.complaint(rows, facts)) is not None]
