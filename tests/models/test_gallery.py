from pathlib import Path

import pytest
from typer.testing import CliRunner

from models.cli import app
from models.gallery import AGENTS
from models.policies import bundle
from tests.models.policies.bundles import tiny_bundle

ROOT = Path(__file__).parents[2]
FIGURES = ROOT / "docs" / "figures"
BYTES_MAX = 300_000


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("bundles")
    for name in AGENTS:
        kind = "one-hot" if "onehot" in name else "prototype"
        task = "parent_child" if name.startswith("parent") else "traffic_junction/medium"
        tiny_bundle(root, task, name, channel=kind)
    out = root / "figures"
    words = ["figures", "--out", str(out), "--bundles", str(root), "--episodes", "60", "--seed", "3"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    return out


def test_the_page_shows_every_picture_and_the_numbers_of_every_agent(drawn: Path) -> None:
    page = (drawn / "README.md").read_text()
    pictures = sorted(drawn.glob("*.svg"))
    assert len(pictures) == 7
    assert all(f"({picture.name})" in page for picture in pictures)
    assert all(f"### {name}\n" in page for name in AGENTS)
    assert "seed 3, 60 episodes" in page


def test_a_missing_agent_is_named_in_one_line(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["figures", "--out", str(tmp_path / "out"), "--bundles", str(tmp_path)])
    assert done.exit_code == 2
    assert done.stderr.startswith("parent_child/prototype-9: no such bundle")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", AGENTS)
def test_the_figures_in_docs_are_about_the_released_agents(name: str) -> None:
    sha256 = bundle.load(ROOT / "models" / "bundles" / name).sha256
    assert sha256 in (FIGURES / "README.md").read_text(), "run `make figures`"


def test_the_figures_in_docs_are_small_and_shown() -> None:
    page = (FIGURES / "README.md").read_text()
    pictures = sorted(FIGURES.glob("*.svg"))
    assert len(pictures) == 7
    for picture in pictures:
        assert picture.stat().st_size <= BYTES_MAX, picture.name
        assert f"({picture.name})" in page
