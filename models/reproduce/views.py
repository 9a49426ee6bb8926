"""How an agent of a table is measured: greedily, masked, at p = .05, and as people meet it."""

from typing import Any

import numpy as np

from models.envs import registry
from models.envs.api import Environment
from models.envs.starts import has_room
from models.envs.traffic_junction import TrafficJunction
from models.evaluate import Question, survey
from models.interpret.summary import interpret, summary
from models.policies.lexicon import Lexicon
from models.policies.recurrent import RecurrentPolicy
from models.policies.team import Team
from models.reproduce.cells import EVALUATION_SEED
from models.training.config import Recipe

SPARSE = 0.05
"""Arrival probability of medium, and of what people meet."""


def views(recipe: Recipe, policy: RecurrentPolicy, episodes: int) -> dict[str, Any]:
    """Every measure of every question, as JSON."""
    env = registry.make(recipe.task)
    team = Team(env, policy)
    return {
        name: survey(env, team, question).to_json()
        for name, question in questions(recipe, env, episodes).items()
    }


def questions(recipe: Recipe, env: Environment[Any], episodes: int) -> dict[str, Question]:
    seed = EVALUATION_SEED
    asked = {"greedy": Question(episodes, seed), "masked": Question(episodes, seed, masked=True)}
    if isinstance(env, TrafficJunction) and env.arrival != SPARSE:
        asked["sparse"] = Question(episodes, seed, arrival=SPARSE)
    if (recipe.start.human or recipe.check.human) and isinstance(env, TrafficJunction) and has_room(env):
        asked["human"] = Question(episodes, seed, "human")
        asked["human_masked"] = Question(episodes, seed, "human", masked=True)
    return asked


def meaning(recipe: Recipe, policy: RecurrentPolicy) -> dict[str, Any] | None:
    """What the tokens of a child mean; None elsewhere."""
    env = registry.make(recipe.task)
    if not env.message_held or policy.tokens == 0:
        return None
    found = interpret(env, policy, EVALUATION_SEED)
    cells = cells_of_tokens(found.lexicon)
    extremes = {"cells_least": min(cells), "cells_most": max(cells)}
    return {**summary(found), "cells_of_token": cells, **extremes}


def cells_of_tokens(lexicon: Lexicon) -> list[int]:
    """In how many cells each token is the one that is said most often."""
    said = lexicon.uses[:, None] * lexicon.probability  # (K, C)
    spoken = said.sum(0) > 0
    return np.bincount(said[:, spoken].argmax(0), minlength=lexicon.tokens).tolist()  # type: ignore[no-any-return]
