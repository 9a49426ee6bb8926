import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from typer.testing import CliRunner

from models.cli import app
from models.envs import registry
from models.interpret.estimate import EPISODES
from models.policies import bundle
from models.policies.plain import PlainPolicy, shapes
from models.policies.recurrent import Architecture
from models.policies.serving import serving
from models.policies.team import Team
from models.rollout import episodes
from server.domain.opening import Opening
from server.ghost.seat import TrainedCrew

TASK, NAME = "parent_child", "parent_child/foreign-9"
WORLD = registry.make(TASK)
SIZES = Architecture(WORLD.observation_size, WORLD.actions, 8, 2, 9, "prototype", "open")
POLICY = """
task = "parent_child"
architecture = "gru"
channel = "prototype"
gate = "open"
hidden = 8
message = 2
tokens = 9
source = "a test, of random numbers"
supervised_help = "none"
"""


def arrays() -> dict[str, np.ndarray]:
    draw = np.random.default_rng(2)
    return {name: draw.normal(size=shape).astype(np.float32) for name, shape in shapes(SIZES).items()}


def written(folder: Path, text: str = POLICY, stored: dict[str, np.ndarray] | None = None) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "policy.toml").write_text(text)
    np.savez(folder / "weights.npz", **(arrays() if stored is None else stored))  # type: ignore[arg-type]
    return folder


def bring(folder: Path, root: Path, name: str = NAME, episodes: int = 20) -> tuple[int, str]:
    words = ["import", str(folder), name, "--bundles", str(root), "--episodes", str(episodes)]
    done = CliRunner().invoke(app, words)
    return done.exit_code, done.stdout + done.stderr


@pytest.fixture
def undemanding(monkeypatch: pytest.MonkeyPatch) -> None:
    """Random weights are good enough."""
    monkeypatch.setattr("models.demands.DEMANDS", {})
    monkeypatch.setitem(EPISODES, TASK, 300)


@pytest.fixture
def held(undemanding: None, tmp_path: Path) -> bundle.PolicyBundle:
    code, said = bring(written(tmp_path / "foreign"), tmp_path / "bundles")
    assert code == 0, said
    found, errors = bundle.find(tmp_path / "bundles")
    assert errors == ()
    assert found[NAME].sha256 in said
    return found[NAME]


def test_foreign_weights_become_a_bundle_that_plays(held: bundle.PolicyBundle, tmp_path: Path) -> None:
    seeds = np.arange(30, dtype=np.uint64)
    own = PlainPolicy.from_weights(SIZES, {name: torch.from_numpy(one) for name, one in arrays().items()})
    played, expected = (episodes(WORLD, Team(WORLD, one), seeds) for one in (held.policy, own))
    assert np.array_equal(played.actions, expected.actions)
    assert np.array_equal(played.tokens, expected.tokens)
    assert len(np.unique(played.tokens[played.gates])) > 1
    assert held.lexicon.samples == 300
    card = (tmp_path / "bundles" / NAME / "CARD.md").read_text()
    assert "trained elsewhere: a test, of random numbers" in card
    assert "network: gru" in card


def test_the_ghost_lets_foreign_agents_speak_and_act(held: bundle.PolicyBundle) -> None:
    crew = TrainedCrew(WORLD, serving(held.policy))
    world = WORLD.init(np.array([5], np.uint64))
    minds = crew.begin(Opening(world, ()))
    played = episodes(WORLD, Team(WORLD, held.policy), np.array([5], np.uint64))
    for step in range(int(played.steps[0])):
        said, minds = crew.speak(world, minds)
        actions, minds = crew.act(world, minds, said)
        assert said.tokens[1] == played.tokens[step, 0, 1]
        assert actions == played.actions[step, 0].tolist()
        world, _ = WORLD.step(world, np.array([actions], np.int32))


def test_safetensors_do_as_well(undemanding: None, tmp_path: Path) -> None:
    folder = written(tmp_path / "foreign")
    (folder / "weights.npz").unlink()
    stored = {name: torch.from_numpy(one) for name, one in arrays().items()}
    save_file(stored, folder / "weights.safetensors")
    assert bring(folder, tmp_path / "bundles")[0] == 0


def test_agents_that_fail_their_own_evaluation_are_refused(tmp_path: Path) -> None:
    code, said = bring(written(tmp_path / "foreign"), tmp_path / "bundles")
    assert (code, said.count("\n")) == (2, 1)
    assert "fails its own evaluation: found" in said
    assert not (tmp_path / "bundles").exists()


def changed(name: str, value: np.ndarray | None) -> dict[str, np.ndarray]:
    stored = arrays()
    stored.pop(name, None)
    return stored if value is None else stored | {name: value}


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda f: written(f, stored=changed("codebook", np.zeros((9, 3), np.float32))), "codebook has"),
        (lambda f: written(f, stored=changed("act.bias", None)), "act.bias is missing or unknown"),
        (lambda f: written(f, stored=changed("extra", np.zeros(1, np.float32))), "extra is missing"),
        (lambda f: written(f, stored=changed("act.bias", np.zeros(5))), "act.bias holds float64"),
        (lambda f: written(f, stored=changed("act.bias", np.full(5, np.nan, np.float32))), "not finite"),
        (lambda f: (f / "weights.npz").write_bytes(b"PK"), "weights.npz: not a whole file"),
        (lambda f: (f / "weights.npz").unlink(), "exactly one is needed"),
        (lambda f: (f / "policy.toml").unlink(), "policy.toml: cannot be read"),
        (lambda f: written(f, "task ="), "policy.toml: not TOML"),
        (lambda f: written(f, POLICY + "mood = 1"), "policy.toml: mood: unknown key"),
        (lambda f: written(f, POLICY.replace("parent_child", "chess")), "unknown task 'chess'"),
        (lambda f: written(f, POLICY.replace('"gru"', '"rnn"')), "policy.toml: architecture:"),
        (lambda f: written(f, POLICY.replace("hidden = 8", "hidden = 9")), "has shape"),
        (lambda f: written(f, POLICY.replace('"prototype"', '"one-hot"')), "as long as the codebook"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_in_one_line(
    tmp_path: Path, spoil: Callable[[Path], object], reason: str
) -> None:
    spoil(written(tmp_path / "foreign"))
    code, said = bring(tmp_path / "foreign", tmp_path / "bundles")
    assert (code, said.count("\n")) == (2, 1)
    assert reason in said


def test_a_name_that_cannot_be_is_refused(tmp_path: Path) -> None:
    assert "is not of the form" in bring(tmp_path, tmp_path, "../x")[1]


def test_only_a_foreign_network_is_named_in_the_manifest(held: bundle.PolicyBundle, tmp_path: Path) -> None:
    said = json.loads((tmp_path / "bundles" / NAME / "manifest.json").read_text())
    assert said["architecture"] == "gru"
