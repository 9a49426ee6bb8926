"""The bundles that are shipped are whole, come from a packaged recipe, and do what their cards say."""

from pathlib import Path

import numpy as np
import pytest

from models.envs import registry
from models.evaluate import Question, evaluate
from models.interpret.nulls import in_use
from models.interpret.plane import APART_PX, PLANE_PX
from models.policies import bundle
from models.policies.bundle import PolicyBundle
from models.policies.team import Team
from models.training import config

MODELS = Path(bundle.__file__).parents[1]
BUNDLES, ERRORS = bundle.find(MODELS / "bundles")
SEARCHERS = [held for name, held in BUNDLES.items() if name.startswith("parent_child/")]
NAMES = {"parent_child/prototype-9", "parent_child/onehot-9"} | {
    f"traffic_junction/budget-{budget}" for budget in ("100", "050", "030")
}


def test_every_shipped_bundle_loads() -> None:
    assert ERRORS == ()
    assert set(BUNDLES) >= NAMES


def test_every_bundle_has_its_recipe_in_the_package() -> None:
    recipes = [config.load(path) for path in (MODELS / "recipes").glob("*.toml")]
    assert {recipe.name for recipe in recipes} >= set(BUNDLES)


@pytest.mark.parametrize("held", SEARCHERS, ids=lambda held: held.name)
def test_searchers_find_the_child_with_nine_tokens_in_use(held: PolicyBundle) -> None:
    env = registry.make(held.manifest.task)
    measured = evaluate(env, Team(env, held.policy), Question(500, seed=11))
    assert measured["steps"].mean <= 7.0
    assert measured["found"].mean >= 0.99
    assert in_use(held.lexicon.uses).sum() == 9
    assert not held.lexicon.null.any()


@pytest.mark.parametrize("held", SEARCHERS, ids=lambda held: held.name)
def test_the_card_and_the_evaluation_are_about_these_weights(held: PolicyBundle) -> None:
    env = registry.make(held.manifest.task)
    again = evaluate(env, Team(env, held.policy), Question(500, seed=12))
    low, high = again["steps"].ci95
    claimed = held.evaluation["rows"]["as_trained"]["steps"]
    assert claimed["ci95"][0] <= high
    assert low <= claimed["ci95"][1]


@pytest.mark.parametrize("held", SEARCHERS, ids=lambda held: held.name)
def test_people_can_tell_nine_tokens_apart_on_the_plane(held: PolicyBundle) -> None:
    points = held.lexicon.positions * np.array(PLANE_PX)
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)[np.triu_indices(9, 1)]
    assert gaps.min() >= APART_PX
