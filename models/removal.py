"""What is lost when null messages are not sent: the same episodes with and without them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from models.evaluate import Measure, Question, evaluate
from models.interpret.mute import WithoutNulls
from models.interpret.turns import for_people
from models.policies.team import Team

if TYPE_CHECKING:
    from models.envs.api import Environment
    from models.policies.api import Policy
    from models.policies.lexicon import Lexicon

EPISODES = 2_000
"""Of each comparison, unless told otherwise."""
REPORTED = ("success", "found", "steps", "arrived", "reward", "message_rate")


def removal(
    env: Environment[Any], policy: Policy, lexicon: Lexicon, episodes: int, seed: int
) -> dict[str, Any] | None:
    """Measure a policy before and after its null messages are gated; None if it sends none.

    By start (`init`, and `human` where there are human trials), then `before` and `after`, then measure.
    """
    if not lexicon.uses[lexicon.null].any():
        return None
    starts: tuple[Literal["init", "human"], ...] = ("init",)
    if for_people(env):
        starts = ("init", "human")
    players = {"before": Team(env, policy), "after": Team(env, WithoutNulls(policy, lexicon.null))}
    return {
        start: {
            when: _plain(evaluate(env, team, Question(episodes, seed, start)))
            for when, team in players.items()
        }
        for start in starts
    }


def _plain(measures: dict[str, Measure]) -> dict[str, Any]:
    return {name: measures[name].to_json() for name in REPORTED if name in measures}
