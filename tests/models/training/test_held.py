"""A run that starts from another one: weights, codebook, gate, and what cannot be started from."""

import tomllib
from pathlib import Path

import pytest
import torch

from models.training import TrainingError, config, held, run
from models.training.trainer import Trainer
from tests.models.reproduce.tiny import NAMES, PLAIN


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """A folder with the finished run `plain-9`."""
    (tmp_path / "plain.toml").write_text(PLAIN.replace("updates = 25", "updates = 2"))
    folder = tmp_path / "plain-9"
    folder.mkdir()
    (folder / held.RECIPE).write_text((tmp_path / "plain.toml").read_text())
    run(folder / held.RECIPE, folder, progress=False)
    return tmp_path


def begun(runs: Path, recipe: str) -> Trainer:
    (runs / "names.toml").write_text(recipe)
    trainer = Trainer(config.load(runs / "names.toml"), runs / "names-9", runs / "bundles")
    trainer.open(resume=False)
    return trainer


def test_weights_are_those_of_the_run_beside_and_the_codebook_is_made_of_its_messages(runs: Path) -> None:
    net = begun(runs, NAMES).learner.net
    before = held.read(runs / "plain-9").policy.weights()
    after = net.state_dict()
    assert all(torch.equal(after[name], weight) for name, weight in before.items())
    assert after.keys() - before.keys() == {"channel.codebook"}
    torch.manual_seed(9)
    chance = Trainer(config.parse({**tomllib.loads(NAMES), "init_from": None}), runs / "chance", runs)
    chance.open(resume=False)
    assert not torch.equal(after["channel.codebook"], chance.learner.net.state_dict()["channel.codebook"])
    assert after["channel.codebook"].abs().max() <= 1  # messages lie between -1 and 1, and so do their means


def test_a_gate_that_the_ancestor_lacks_begins_open(runs: Path) -> None:
    trainer = begun(runs, NAMES.replace("hidden = 8", 'hidden = 8\ngate = "learned"'))
    gate = {name: value for name, value in trainer.learner.net.state_dict().items() if "gate" in name}
    assert gate["gate.2.bias"].tolist() == [1.0]
    assert not gate["gate.2.weight"].any()


@pytest.mark.parametrize(
    ("before", "after", "reason"),
    [
        ("run:plain", "run:nobody", "not the folder of a run"),
        ("seed = 9", "seed = 8", "plain-8: not the folder of a run"),
        ("hidden = 8", "hidden = 9", "its sizes are not those of"),
    ],
)
def test_what_cannot_be_started_from_is_said_in_one_line(
    runs: Path, before: str, after: str, reason: str
) -> None:
    with pytest.raises(TrainingError, match=reason) as error:
        begun(runs, NAMES.replace(before, after))
    assert "\n" not in str(error.value)


def test_an_unfinished_run_is_no_start(runs: Path) -> None:
    text = PLAIN.replace("updates = 25", "updates = 3")
    (runs / "half.toml").write_text(text)
    trainer = Trainer(config.load(runs / "half.toml"), runs / "half-9", runs)
    trainer.open(resume=False)
    trainer.advance()
    (runs / "half-9" / held.RECIPE).write_text(text)
    with pytest.raises(TrainingError, match="half-9: not finished"):
        begun(runs, NAMES.replace("run:plain", "run:half"))


def test_a_run_is_read_with_the_messages_of_its_phase(runs: Path) -> None:
    found = held.read(runs / "plain-9")
    assert (found.finished, found.updates, found.steps) == (True, 2, 2 * 4 * 20)
    assert found.policy.channel == "continuous"


def test_the_name_of_weights_changes_with_any_of_them(runs: Path) -> None:
    weights = held.read(runs / "plain-9").policy.weights()
    name = held.weights_sha256(weights)
    assert name == held.weights_sha256(dict(reversed(weights.items())))
    weights["head.2.bias"] = weights["head.2.bias"] + 1e-7
    assert held.weights_sha256(weights) != name
