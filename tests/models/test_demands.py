import pytest

from models.demands import DEMANDS, complaints


def row(low: float, mean: float, high: float) -> dict[str, object]:
    return {"mean": mean, "ci95": [low, high]}


def rows(**changed: float) -> dict[str, dict[str, dict[str, object]]]:
    """A good driver at b = .3, but for what is named."""
    value = {"success": 0.98, "masked": 0.74, "rate": 0.3, "human_rate": 0.31, "arrived": 0.98} | changed
    return {
        "as_trained": {
            "success": row(value["success"] - 0.01, value["success"], 1),
            "message_rate": row(0, value["rate"], 1),
        },
        "masked": {"success": row(0, value["masked"], value["masked"] + 0.01)},
        "human": {"message_rate": row(0, value["human_rate"], 1), "arrived": row(0, value["arrived"], 1)},
    }


FACTS = {"budget": 0.3, "tokens": 112}


def test_a_good_driver_is_released() -> None:
    assert complaints("traffic_junction/medium", rows(), FACTS) == []


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"success": 0.94}, "success (as_trained) is 0.940, at least 0.95 is needed"),
        ({"masked": 0.97}, "success (as_trained) is 0.980, no better than masked (0.970)"),
        ({"rate": 0.34}, "message_rate (as_trained) is 0.340, budget 0.3 is missed by more than 0.03"),
        ({"human_rate": 0.25}, "message_rate (human) is 0.250, budget 0.3 is missed by more than 0.03"),
        ({"arrived": 0.9}, "arrived (human) is 0.900, at least 0.95 is needed"),
    ],
)
def test_every_fault_of_a_driver_is_named(changed: dict[str, float], said: str) -> None:
    assert complaints("traffic_junction/medium", rows(**changed), FACTS) == [said]


def test_a_crossing_without_human_trials_is_judged_by_the_rest() -> None:
    easy = {name: measures for name, measures in rows(success=0.5).items() if name != "human"}
    assert len(complaints("traffic_junction/easy", easy, FACTS)) == 1


def test_a_child_must_be_found_soon_and_use_all_its_tokens() -> None:
    def child(found: float, steps: float, used: float) -> list[str]:
        measured = {"found": found, "steps": steps, "tokens_used": used}
        numbers = {name: row(0, value, 1) for name, value in measured.items()}
        return list(complaints("parent_child", {"as_trained": numbers}, {"budget": 1, "tokens": 9}))

    assert child(0.999, 6.4, 9) == []
    assert child(0.98, 7.2, 8) == [
        "found (as_trained) is 0.980, at least 0.99 is needed",
        "steps (as_trained) is 7.200, at most 7 is allowed",
        "tokens_used (as_trained) is 8.000, tokens 9 is missed by more than 0",
    ]


def test_a_size_has_its_own_demands_or_those_of_its_folder() -> None:
    poor = {"as_trained": {"reward": row(0, 2.3, 3)}}
    assert complaints("predator_prey/5x5", poor, {}) == []
    assert len(complaints("predator_prey/10x10", poor, {})) == 1
    assert {task.split("/")[0] for task in DEMANDS} == {"traffic_junction", "parent_child", "predator_prey"}
