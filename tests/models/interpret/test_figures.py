import csv
import json
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from models.envs import registry
from models.interpret import figures, tokens
from models.interpret.correlation import distances
from models.interpret.shared import Shared
from models.interpret.summary import Meaning, interpret, summary
from models.policies.lexicon import Lexicon
from tests.models.interpret.speakers import Babbler, Honest
from tests.models.policies.bundles import tiny_policy

SEARCH = registry.make("parent_child")
MEDIUM = registry.make("traffic_junction/medium")


def meaning(tokens: int = 9, spoken: int = 8) -> Meaning:
    rng = np.random.default_rng(0)
    counts = np.zeros((tokens, 81), int)
    counts[:spoken] = rng.integers(0, 60, (spoken, 81)) * (rng.random((spoken, 81)) < 0.4)
    places = rng.random((tokens, 2))
    lexicon = Lexicon.from_counts(counts, places, (0.6, 0.2), seed=1, coordinates=places)
    return Meaning(lexicon, distances(lexicon, places, (9, 9)), Shared(1.0, 1.1, 6.3))


def texts(path: Path) -> str:
    said = (node.text or "" for node in ET.parse(path).iter() if node.tag.endswith(("text", "tspan")))
    return " | ".join(said)


def drawn(made: Meaning, name: str, folder: Path) -> str:
    (path,) = figures.write({name: figures.figures(SEARCH, made)[name]}, folder)
    return texts(path)


def test_every_figure_is_an_svg_that_names_its_axes_and_units(tmp_path: Path) -> None:
    written = figures.write(figures.figures(SEARCH, meaning()), tmp_path)
    said = {
        "prototypes": "60.0 % of variance",
        "heatmaps": "P(cell | token)",
        "distances": "(cells)",
        "token-use": "share of messages",
        "null-tokens": "(bits)",
        "null-threshold": "share of H(cell)",
    }
    assert [path.stem for path in written] == list(said)
    for path, words in zip(written, said.values(), strict=True):
        assert words in texts(path), path.name


def test_there_is_one_heat_map_for_each_token_that_says_where(tmp_path: Path) -> None:
    made = meaning(spoken=5)
    assert drawn(made, "heatmaps", tmp_path).count(" bit") == (~made.lexicon.null).sum() == 5


def test_of_many_tokens_the_most_used_are_shown_and_the_others_counted(tmp_path: Path) -> None:
    said = drawn(meaning(tokens=60, spoken=60), "heatmaps", tmp_path)
    assert said.count(" bit") == 45
    assert "45 most used of 60" in said


def test_a_language_that_says_nothing_has_an_empty_heat_map(tmp_path: Path) -> None:
    assert "no token says where" in drawn(meaning(spoken=0), "heatmaps", tmp_path)


def test_a_language_without_distances_still_has_a_figure(tmp_path: Path) -> None:
    assert "fewer than 3 pairs" in drawn(meaning(spoken=1), "distances", tmp_path)


def test_many_pairs_are_counted_in_boxes_and_few_are_points(tmp_path: Path) -> None:
    (few,) = figures.write({"few": figures.distance_scatter(meaning().distances)}, tmp_path)
    (many,) = figures.write({"many": figures.distance_scatter(meaning(100, 100).distances)}, tmp_path)
    assert "4,950 pairs" in texts(many)
    assert many.stat().st_size < 120_000
    assert "mark-rect" not in few.read_text()
    assert "mark-rect" in many.read_text()


def test_png_is_written_beside_svg_on_request(tmp_path: Path) -> None:
    charts = figures.figures(SEARCH, meaning())
    written = figures.write({"token-use": charts["token-use"]}, tmp_path, png=True)
    assert written[1].read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("task", "strips"), [("parent_child", 81), ("traffic_junction/easy", 2), ("traffic_junction/hard", 8)]
)
def test_the_ground_is_a_grid_or_the_lanes(task: str, strips: int) -> None:
    env = registry.make(task)
    floor = figures.ground(env)
    assert len(floor.strips) == strips
    covered = {
        y * env.shape[1] + x
        for left, top, right, bottom in floor.strips
        for x in range(left, right)
        for y in range(top, bottom)
    }
    road = env.roads.road_cells.tolist() if task.startswith("traffic") else range(81)
    assert covered == set(road)


@pytest.fixture(scope="module")
def honest() -> Meaning:
    return interpret(MEDIUM, Honest(MEDIUM), seed=1, count=160)


def test_traffic_comes_with_calibration_route_lanes_and_actions(honest: Meaning, tmp_path: Path) -> None:
    charts = figures.figures(MEDIUM, honest)
    new = ("calibration", "rate-along-route", "lanes-and-actions", "gas-by-token")
    said = [texts(path) for path in figures.write({name: charts[name] for name in new}, tmp_path)]
    words = ("calibration error", "since the entrance", "On which lane", "in the same step")
    assert all(word in text for word, text in zip(words, said, strict=True))
    assert "a car appears: 100.0 %" in said[1]


def test_the_summary_of_traffic_holds_every_measure(honest: Meaning) -> None:
    numbers = summary(honest)
    assert set(numbers["calibration"]) == {"spoke", "all_cars"}
    assert numbers["calibration"]["spoke"]["trials"] == 40
    assert numbers["distance_r2"] == pytest.approx(1)
    assert numbers["distance_slope_cells_per_unit"] == pytest.approx(1)
    assert numbers["distance_r2_ci95"] == pytest.approx([1, 1])
    assert numbers["mutual_information_bits"] == pytest.approx(numbers["cell_entropy_bits"])
    assert numbers["bursts"]["least"] == numbers["bursts"]["most"] == 1
    assert numbers["traffic"]["rate"]["mean"] == 1
    assert "left_out" not in numbers
    assert json.loads(json.dumps(numbers, allow_nan=False))["traffic"] == numbers["traffic"]


def test_tokens_are_a_table_with_a_line_for_each(honest: Meaning, tmp_path: Path) -> None:
    tokens.write(honest, tmp_path / "tokens.csv")
    with (tmp_path / "tokens.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == honest.lexicon.tokens
    assert sum(int(line["messages"]) for line in lines) == honest.lexicon.samples
    lanes = [name for name in lines[0] if name.startswith("messages_")]
    assert lanes == [
        "messages_down_column_6",
        "messages_left_row_6",
        "messages_right_row_7",
        "messages_up_column_7",
    ]
    assert all(sum(int(line[lane]) for lane in lanes) == int(line["messages"]) for line in lines)


def test_a_search_has_no_traffic_and_says_what_is_left_out() -> None:
    made = interpret(SEARCH, tiny_policy(), seed=1, count=200)
    assert made.calibration is None
    numbers = summary(made)
    assert not {"calibration", "traffic", "bursts"} & set(numbers)
    assert numbers["left_out"].startswith("no traffic")


def test_a_hunt_is_read_like_any_other_world(tmp_path: Path) -> None:
    env = registry.make("predator_prey/5x5")
    made = interpret(env, tiny_policy("predator_prey/5x5"), seed=1, count=100)
    numbers = summary(made)
    assert numbers["messages"] == 100 * env.steps_max * env.agents  # open gate, prey included
    assert numbers["bursts"]["most"] == 1
    assert numbers["left_out"].startswith("no traffic")
    assert len(figures.write(figures.figures(env, made), tmp_path)) == 6


def test_a_token_that_nobody_says_has_no_lane_and_no_action_to_draw(tmp_path: Path) -> None:
    policy = Babbler(MEDIUM)
    policy.tokens = 5
    charts = figures.figures(MEDIUM, interpret(MEDIUM, policy, seed=1, count=10))
    (path,) = figures.write({"lanes-and-actions": charts["lanes-and-actions"]}, tmp_path)
    assert "What does it do?" in texts(path)


def test_the_smallest_crossing_has_no_human_trials_and_is_read_in_its_own_episodes(tmp_path: Path) -> None:
    env = registry.make("traffic_junction/easy")
    made = interpret(env, Honest(env), seed=1, count=100)
    assert made.calibration is None
    assert made.traffic is not None
    assert len(made.traffic.lanes.names) == 2
    assert summary(made)["left_out"].startswith("no room for human trials")
    assert "rate-along-route" in figures.figures(env, made)
