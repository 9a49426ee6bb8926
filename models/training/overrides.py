"""What else acts in training: the rule, in its share of episodes, and a wobbling participant."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.envs.traffic_junction import BRAKE
from models.training.config import Phase, Recipe
from models.training.curriculum import Progress, rule_share
from models.training.imitation import labels
from models.training.situations import OVERRIDES, uniforms
from models.training.unroll import Unrolled


class Overrides:
    """The overrides of one update; collects the rule's actions on the way, as labels."""

    def __init__(self, env: Any, recipe: Recipe, phase: Phase, at: Progress, update: int) -> None:
        self._env, self._recipe, self._careful = env, recipe, phase.careful
        self.labels: list[NDArray[np.int32]] = []
        self._wants_labels = phase.kind == "imitate" or phase.imitation_weight > 0
        steps, batch = env.steps_max, phase.episodes
        draws = uniforms(recipe.seed, OVERRIDES, update, batch * (steps + 1)).reshape(steps + 1, batch)
        self._ruled = draws[0] < rule_share(at, phase)  # (B,)
        self._wobbles = draws[1:] < recipe.start.wobble  # (T, B)
        self.use = self if self._wants_labels or recipe.start.wobble else None

    def rows(self, seen: Unrolled) -> NDArray[np.int64] | None:
        """The rule's actions (M,) in the window that was just played."""
        if not self._wants_labels:
            return None
        rule = np.stack(self.labels[-len(seen.living) :])  # (T, B, N)
        return rule.reshape(len(rule), -1)[seen.step, seen.place].astype(np.int64)

    def __call__(self, step: int, state: Any, actions: NDArray[np.int32]) -> NDArray[np.int32]:
        if self._wants_labels:
            rule = labels(self._env, state, careful=self._careful)
            self.labels.append(rule)
            actions = np.where(self._ruled[:, None], rule, actions)
        return self._wobbled(step, state, actions) if self._recipe.start.wobble else actions

    def _wobbled(self, step: int, state: Any, actions: NDArray[np.int32]) -> NDArray[np.int32]:
        """Traffic Junction: the participant's car brakes now and then."""
        wobbling = self._wobbles[step] & (state.guest >= 0)
        if wobbling.any():
            actions = actions.copy()
            actions[wobbling, state.guest[wobbling]] = BRAKE
        return actions
