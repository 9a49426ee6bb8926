from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from models.envs import registry
from models.interpret import figures
from models.interpret.correlation import distances
from models.interpret.summary import Meaning, interpret, summary
from models.policies.lexicon import Lexicon
from tests.models.interpret.speakers import Honest
from tests.models.policies.bundles import tiny_policy

MEDIUM = registry.make("traffic_junction/medium")


def meaning(tokens: int = 9, spoken: int = 8) -> Meaning:
    rng = np.random.default_rng(0)
    counts = np.zeros((tokens, 81), int)
    counts[:spoken] = rng.integers(0, 60, (spoken, 81))
    places = rng.random((tokens, 2))
    lexicon = Lexicon.from_counts(counts, places, (0.6, 0.2), seed=1, coordinates=places)
    return Meaning(lexicon, distances(lexicon, places, (9, 9)), None)


def texts(path: Path) -> str:
    said = (node.text or "" for node in ET.parse(path).iter() if node.tag.endswith(("text", "tspan")))
    return " | ".join(said)


def test_every_figure_is_an_svg_that_names_its_axes_and_units(tmp_path: Path) -> None:
    made = meaning()
    written = figures.write(figures.figures(made.lexicon, made.distances, (9, 9)), tmp_path)
    assert [path.name for path in written] == [
        "prototypes.svg",
        "heatmaps.svg",
        "distances.svg",
        "token-use.svg",
        "null-tokens.svg",
    ]
    for path, words in zip(
        written,
        ("60.0 % of variance", "P(cell | token)", "(cells)", "share of messages", "(bits)"),
        strict=True,
    ):
        assert words in texts(path), path.name


def test_there_is_one_heat_map_for_each_token_that_was_said(tmp_path: Path) -> None:
    made = meaning(spoken=5)
    charts = figures.figures(made.lexicon, made.distances, (9, 9))
    (path,) = figures.write({"heatmaps": charts["heatmaps"]}, tmp_path)
    assert texts(path).count(" bit") == 5


def test_a_language_without_distances_still_has_a_figure(tmp_path: Path) -> None:
    made = meaning(spoken=1)
    charts = figures.figures(made.lexicon, made.distances, (9, 9))
    (path,) = figures.write({"distances": charts["distances"]}, tmp_path)
    assert "no line" in texts(path)


def test_png_is_written_beside_svg_on_request(tmp_path: Path) -> None:
    made = meaning()
    charts = figures.figures(made.lexicon, made.distances, (9, 9))
    written = figures.write({"token-use": charts["token-use"]}, tmp_path, png=True)
    assert written[1].read_bytes().startswith(b"\x89PNG")


def test_traffic_comes_with_calibration(tmp_path: Path) -> None:
    made = interpret(MEDIUM, Honest(MEDIUM), seed=1, count=160)
    assert made.calibration is not None
    charts = figures.figures(made.lexicon, made.distances, MEDIUM.shape, made.calibration)
    (path,) = figures.write({"calibration": charts["calibration"]}, tmp_path)
    assert "calibration error" in texts(path)
    numbers = summary(made)
    assert set(numbers["calibration"]) == {"spoke", "all_cars"}
    assert numbers["calibration"]["spoke"]["trials"] == 40
    assert numbers["distance_r2"] == pytest.approx(1)
    assert numbers["distance_slope_cells_per_unit"] == pytest.approx(1)


def test_a_search_has_no_triangles_to_calibrate() -> None:
    made = interpret(registry.make("parent_child"), tiny_policy(), seed=1, count=200)
    assert made.calibration is None
    assert "calibration" not in summary(made)
