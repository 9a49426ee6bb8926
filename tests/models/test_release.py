import json
from pathlib import Path

import pytest

from models import training
from models.policies import bundle
from models.release import ReleaseError, release
from models.training.held import Provenance

RECIPE = """
name = "parent_child/short-9"
task = "parent_child"
seed = 3
[model]
hidden = 8
message = 9
tokens = {tokens}
channel = "{channel}"
[check]
every = 1
episodes = 20
[[phase]]
name = "all"
updates = {updates}
episodes = 8
"""


def trained(
    folder: Path, channel: str = "prototype", tokens: int = 9, updates: int = 2, seed: str = "3"
) -> Path:
    folder.mkdir()
    text = RECIPE.format(channel=channel, tokens=tokens, updates=updates)
    (folder / "recipe.toml").write_text(text.replace("seed = 3", f"seed = {seed}"))
    training.run(folder / "recipe.toml", folder, progress=False)
    return folder


@pytest.fixture
def undemanding(monkeypatch: pytest.MonkeyPatch) -> None:
    """Agents of two updates are good enough."""
    monkeypatch.setattr("models.demands.DEMANDS", {})


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = trained(tmp_path_factory.mktemp("runs") / "short")
    Provenance("a" * 40).write(folder)
    return folder


@pytest.mark.usefixtures("undemanding")
def test_a_run_becomes_a_bundle_that_loads_and_says_where_it_comes_from(
    finished: Path, tmp_path: Path
) -> None:
    made = release(finished, None, tmp_path, episodes=30, lexicon_episodes=300)
    loaded = bundle.load(tmp_path / "parent_child/short-9")
    assert loaded.sha256 == made.sha256
    manifest = loaded.manifest
    assert (manifest.name, manifest.task, manifest.seed) == ("parent_child/short-9", "parent_child", 3)
    assert manifest.git_commit == "a" * 40
    assert manifest.steps_trained > 0
    assert manifest.recipe["phase"][0]["updates"] == 2
    assert loaded.lexicon.samples == 300


@pytest.mark.usefixtures("undemanding")
def test_the_evaluation_was_measured_and_the_card_repeats_it(finished: Path, tmp_path: Path) -> None:
    made = release(finished, "parent_child/other-9", tmp_path, episodes=30, lexicon_episodes=300)
    rows = made.evaluation["rows"]
    assert set(rows) == {"as_trained", "masked", "scripted:seeker", "scripted:oracle"}
    assert rows["masked"]["message_rate"]["mean"] == 0
    card = (tmp_path / "parent_child/other-9/CARD.md").read_text()
    assert f"| as trained | {rows['as_trained']['steps']['mean']:.2f} [" in card
    assert "prototype, 9 tokens of 9 numbers" in card
    assert made.evaluation["meaning"]["messages"] == 300


@pytest.mark.usefixtures("undemanding")
def test_releasing_twice_gives_the_same_files_but_for_the_date(finished: Path, tmp_path: Path) -> None:
    for place in ("one", "two"):
        release(finished, None, tmp_path / place, episodes=20, lexicon_episodes=200)
    one, two = (tmp_path / place / "parent_child/short-9" for place in ("one", "two"))
    for name in ("weights.safetensors", "lexicon.json", "evaluation.json"):
        assert (one / name).read_bytes() == (two / name).read_bytes()
    manifests = [json.loads((place / "manifest.json").read_text()) for place in (one, two)]
    for manifest in manifests:
        manifest.pop("created")
        manifest["files"].pop("CARD.md")
    assert manifests[0] == manifests[1]


@pytest.mark.usefixtures("undemanding")
def test_a_run_in_another_world_becomes_a_bundle_too(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    recipe = RECIPE.replace("parent_child/short-9", "predator_prey/short-9").format(
        tokens=9, channel="prototype", updates=1
    )
    (tmp_path / "run/recipe.toml").write_text(recipe.replace('"parent_child"', '"predator_prey/5x5"'))
    training.run(tmp_path / "run/recipe.toml", tmp_path / "run", progress=False)
    made = release(tmp_path / "run", None, tmp_path, episodes=10, lexicon_episodes=20)
    rows = bundle.load(tmp_path / "predator_prey/short-9").evaluation["rows"]
    assert set(rows) == {"as_trained", "masked", "scripted:random", "scripted:straight"}
    assert made.evaluation["meaning"]["messages"] == 20 * 20 * 4
    card = (tmp_path / "predator_prey/short-9/CARD.md").read_text()
    assert f" {rows['scripted:straight']['reward']['mean']:.2f} [" in card


@pytest.mark.usefixtures("undemanding")
def test_a_one_hot_card_warns_that_places_mean_nothing(tmp_path: Path) -> None:
    folder = trained(tmp_path / "run", channel="one-hot", updates=1)
    made = release(folder, None, tmp_path / "bundles", episodes=10, lexicon_episodes=100)
    card = (tmp_path / "bundles" / made.name / "CARD.md").read_text()
    assert "One-hot tokens have no geometry" in card
    assert made.evaluation["meaning"]["distance_r2"] is None


def test_more_tokens_than_digit_keys_are_refused(tmp_path: Path) -> None:
    folder = trained(tmp_path / "run", tokens=12, updates=1)
    with pytest.raises(ReleaseError, match="12 tokens, but parent_child is played with at most 9"):
        release(folder, None, tmp_path, episodes=10)


def test_a_channel_without_tokens_is_refused(tmp_path: Path) -> None:
    folder = trained(tmp_path / "run", channel="continuous", tokens=0, updates=1)
    with pytest.raises(ReleaseError, match="continuous channel has no tokens"):
        release(folder, None, tmp_path, episodes=10)


def test_a_run_that_fails_its_own_evaluation_is_refused_and_nothing_is_written(
    finished: Path, tmp_path: Path
) -> None:
    with pytest.raises(
        ReleaseError, match=r"fails its own evaluation: found .* at least 0.99 is needed; steps"
    ):
        release(finished, None, tmp_path, episodes=30)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("undemanding")
def test_what_a_run_goes_on_from_is_removed_once_it_is_released(tmp_path: Path) -> None:
    folder = trained(tmp_path / "run", updates=1)
    packed = folder / "resume.safetensors"
    packed.write_bytes(b"")
    release(folder, None, tmp_path / "bundles", episodes=10, lexicon_episodes=100)
    assert not packed.exists()


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReleaseError, match="not the folder of a run"):
        release(tmp_path, None, tmp_path)
    (tmp_path / "recipe.toml").write_text(RECIPE)
    with pytest.raises(ReleaseError, match="nothing was trained yet"):
        release(tmp_path, None, tmp_path)


def test_provenance_is_unknown_where_nobody_wrote_it(tmp_path: Path) -> None:
    assert Provenance.read(tmp_path).git_commit == "unknown"
    assert len(Provenance.here().git_commit) in {7, 40}
