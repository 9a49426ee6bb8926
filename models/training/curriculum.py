"""Where a training run is: the phase, what ends it, and what moves linearly inside it."""

from dataclasses import asdict, dataclass, replace
from typing import Any

from models.training.config import Phase, Recipe


@dataclass(frozen=True, slots=True)
class Progress:
    """A place in a recipe."""

    phase: int = 0
    """Index of the phase."""
    update: int = 0
    """Updates done in this phase."""
    total: int = 0
    """Updates done in all."""
    steps: int = 0
    """Environment steps done in all."""
    held: int = 0
    """Checks in a row at which the criterion to leave held."""

    def to_dict(self) -> dict[str, int]:
        return asdict(self)

    @classmethod
    def from_dict(cls, raw: dict[str, Any]) -> "Progress":
        return cls(**raw)

    def updated(self, steps: int) -> "Progress":
        """One update further, which cost so many environment steps."""
        return replace(self, update=self.update + 1, total=self.total + 1, steps=self.steps + steps)

    def checked(self, phase: Phase, success: float) -> "Progress":
        """After a check with this success."""
        held = self.held + 1 if phase.leave is not None and success >= phase.leave.success else 0
        return replace(self, held=held)

    def ends(self, phase: Phase) -> bool:
        """Whether the phase is over: out of updates, or its criterion has held."""
        criterion = phase.leave is not None and self.held >= phase.leave.checks
        return criterion or self.update >= phase.updates

    def next_phase(self) -> "Progress":
        return replace(self, phase=self.phase + 1, update=0, held=0)


def between(start: float, end: float | None, progress: Progress, phase: Phase) -> float:
    """Linear from the start of the phase to its end; constant if there is no end."""
    if end is None:
        return start
    return start + (end - start) * min(1.0, progress.update / max(1, phase.updates - 1))


def rule_share(progress: Progress, phase: Phase) -> float:
    """Share of episodes that the rule drives: falls to none at the middle of the phase."""
    return phase.rule_share * max(0.0, 1 - 2 * progress.update / phase.updates)


def same_regime(recipe: Recipe, one: int, other: int) -> bool:
    """Whether checks of two phases can be compared: same messages, same rule for the gate."""
    a, b = recipe.phase[one], recipe.phase[other]
    return (a.discrete, a.gate == "open", a.budget) == (b.discrete, b.gate == "open", b.budget)
