"""Recipes: what is wrong is named, and the shipped ones are right."""

import copy
from pathlib import Path

import pytest

from models.training.config import Phase, Recipe, RecipeError, load, parse

RECIPES = sorted((Path(__file__).parents[3] / "models" / "recipes").glob("*.toml"))

GOOD = {
    "name": "traffic_junction/test-1",
    "task": "traffic_junction/easy",
    "seed": 1,
    "model": {"tokens": 8, "message": 4, "channel": "prototype", "gate": "learned"},
    "phase": [{"name": "one", "kind": "imitate"}],
}


def changed(path: str, value: object) -> dict:
    raw = copy.deepcopy(GOOD)
    *parents, last = path.split(".")
    place = raw
    for key in parents:
        place = place[int(key)] if isinstance(place, list) else place.setdefault(key, {})
    place[last] = value
    return raw


def test_a_good_recipe_is_read():
    assert parse(GOOD).phase[0].kind == "imitate"


@pytest.mark.parametrize(
    ("path", "value", "reason"),
    [
        ("sped", 1, "sped: unknown key"),
        ("phase.0.epsiodes", 5, "phase.0.epsiodes: unknown key"),
        ("model.chanel", "none", "model.chanel: unknown key"),
        ("task", "chess", "unknown task 'chess'; choose one of traffic_junction/easy"),
        ("name", "Budget", "name: String should match pattern"),
        ("seed", -1, "seed: Input should be greater than or equal to 0"),
        ("phase", [], "phase: Tuple should have at least 1 item"),
        ("phase.0.lr", 0, "phase.0.lr: Input should be greater than 0"),
        ("phase.0.gate", "budget", "phase.0: gate 'budget' needs a budget"),
        ("phase.0.gate", "rewarded", "phase.0: gate 'rewarded' changes the reward"),
        ("model.gate", "ajar", "model.gate: Input should be 'open' or 'learned'"),
        ("model.tokens", 0, "model.tokens is for prototype and one-hot channels"),
        ("model.channel", "one-hot", "set model.message = model.tokens"),
        ("decoder.target", "location", "does not fit traffic_junction/easy"),
        ("task", "parent_child", "parent_child has no rule to imitate"),
        ("check.score", "fun", "check.score: Input should be 'success' or 'reward'"),
    ],
)
def test_a_wrong_recipe_is_refused_in_one_line_that_names_the_field(path, value, reason):
    with pytest.raises(RecipeError) as error:
        parse(changed(path, value), "my.toml")
    line = str(error.value)
    assert line.startswith("my.toml: ")
    assert reason in line
    assert "\n" not in line


HUNT = {**GOOD, "name": "predator_prey/test-1", "task": "predator_prey/5x5"}


def test_a_hunt_can_be_imitated_and_read_for_the_place_of_the_prey():
    for target in ("location", "coordinates"):
        recipe = parse({**HUNT, "decoder": {"target": target}})
        assert (recipe.phase[0].kind, recipe.decoder.target) == ("imitate", target)


@pytest.mark.parametrize(
    "extra",
    [
        {"start": {"human": 0.5}},
        {"check": {"human": 10}},
        {"phase": [{"name": "one", "kind": "imitate", "brake_weight": 2.0}]},
        {"phase": [{"name": "one", "first_collision_only": True}]},
        {"decoder": {"target": "occupancy"}},
    ],
)
def test_a_hunt_has_no_traffic(extra):
    with pytest.raises(RecipeError, match=r"predator_prey/5x5 has no traffic|does not fit predator_prey/5x5"):
        parse({**HUNT, **extra})


def test_a_gate_cannot_be_taught_to_a_policy_without_one():
    raw = changed("model.gate", "open")
    raw["phase"][0] |= {"gate": "budget", "budget": 0.5}
    with pytest.raises(RecipeError, match=r'needs? model|model\.gate = "learned"'):
        parse(raw)


def test_the_policy_gradient_needs_whole_episodes_and_drawn_actions():
    for extra in ({"window": 5}, {"sampled": False}):
        with pytest.raises(RecipeError, match="policy gradient needs"):
            parse({**GOOD, "phase": [{"name": "one", "kind": "reinforce", **extra}]})


def test_a_missing_file_and_a_broken_one_say_so(tmp_path):
    with pytest.raises(RecipeError, match=r"none\.toml: cannot be read"):
        load(tmp_path / "none.toml")
    (tmp_path / "broken.toml").write_text("name = \n")
    with pytest.raises(RecipeError, match=r"broken\.toml: not TOML"):
        load(tmp_path / "broken.toml")


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_every_shipped_recipe_can_be_followed(path):
    assert load(path).phase


@pytest.mark.parametrize("kind", [Recipe, Phase])
def test_every_field_says_what_it_is(kind):
    assert all(
        field.description or name in ("model", "start", "decoder", "check")
        for name, field in kind.model_fields.items()
    )
