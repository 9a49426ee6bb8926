"""What the agents' cards say, against the bundle that they speak of."""

from dataclasses import replace

import pytest

from server.domain.errors import NotFoundError
from server.services import agents
from server.services.lab import Lab
from server.storage.database import Database
from tests.fakes import fake_bundle, fake_lab

MEASURED = {"mean": 0.5, "ci95": [0.25, 0.75]}
EVALUATION = {
    "episodes": 1500,
    "rows": {
        "masked": {"success": {"mean": 0.1, "ci95": [0.0, 0.2]}},
        "scripted:always-gas human": {"success": MEASURED},
        "human": {"success": MEASURED, "arrived": {"mean": 0.975, "ci95": [0.9, 1.0]}},
        "as_trained": {
            "success": {"mean": 0.9876, "ci95": [0.98, 0.99]},
            "reward": {"mean": -1.5, "ci95": [-2.0, -1.0]},
        },
    },
    "meaning": {
        "null_messages": 0.25,
        "tokens_in_use": 7,
        "calibration": {
            "spoke": {"ece": 0.0123, "ece_ci95": [0.01, 0.02], "bins": [{"said": 0.1, "seen": 0.2}]}
        },
    },
}


@pytest.fixture
def lab(sqlite_database: Database) -> Lab:
    return fake_lab(sqlite_database)


def evaluated() -> agents.AgentFacts:
    return agents.facts(replace(fake_bundle("traffic_junction/budget-030"), evaluation=EVALUATION))


def test_the_conditions_stand_in_the_order_of_their_meaning_and_say_what_was_measured() -> None:
    found = evaluated().evaluation
    assert found.episodes == "1,500"
    assert found.measures == ("Success", "Arrived", "Reward")
    assert [name for name, _ in found.conditions] == [
        "As trained",
        "Messages masked",
        "In participants’ trials",
        "Scripted always gas, in participants’ trials",
    ]
    trained = found.conditions[0][1]
    assert [figure.value for figure in trained] == ["98.8\u00a0%", "", "-1.50"]
    assert trained[0].range == "98.0\u00a0% to 99.0\u00a0%"


def test_the_headline_and_the_meaning_are_those_of_the_bundle() -> None:
    found = evaluated()
    assert [(figure.name, figure.value) for figure in found.headline] == [
        ("Success", "98.8\u00a0%"),
        ("Arrived in participants’ trials", "97.5\u00a0%"),
    ]
    assert [(figure.name, figure.value, figure.range) for figure in found.evaluation.meaning] == [
        ("Messages that say nothing", "25.0\u00a0%", ""),
        ("Calibration error", "0.0123", "0.0100 to 0.0200"),
    ]
    assert found.evaluation.calibration == ((0.1, 0.2),)
    assert (found.tokens, found.tokens_used, found.tokens_null, found.budget) == (16, 7, 1, 0.3)


def test_an_agent_without_an_evaluation_says_so_and_nothing_else() -> None:
    found = agents.facts(fake_bundle("parent_child/onehot-9"))
    assert found.headline == ()
    assert found.evaluation == agents.Evaluation("", (), (), (), ())
    assert found.tokens_used == 9


def test_the_picture_of_a_token_shows_the_cells_where_it_was_said() -> None:
    bundle = fake_bundle("parent_child/prototype-9")
    (rows, columns), tokens = agents.meanings(bundle)
    assert (rows, columns) == (9, 9)
    assert [token.token for token in tokens] == list(range(9))
    assert sum(token.share for token in tokens) == pytest.approx(1)
    for token in tokens:
        drawn = {row * columns + column for row, column, _ in token.cells}
        assert drawn == set(bundle.lexicon.probability[token.token].nonzero()[0])
        assert max(strength for _, _, strength in token.cells) == 1


def test_agents_are_listed_by_name_and_an_unknown_one_is_not_found(lab: Lab) -> None:
    assert [each.name for each in agents.every(lab)] == sorted(lab.bundles)
    with pytest.raises(NotFoundError):
        agents.find(lab, "parent_child/nobody")
