"""A packed run goes on where it was, nearly as it was."""

import shutil

import pytest
import torch
from typer.testing import CliRunner

from models.cli import app
from models.training import config, log, packed, run
from models.training.checkpoint import FILE, PACKED, CheckpointError, discard_resume, read
from models.training.packed import PackError, pack, unpack
from models.training.trainer import Trainer
from tests.models.training.small import RECIPE


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """A run that was left after 12 of its 13 updates, with Adam's moments filled and a best."""
    folder = tmp_path_factory.mktemp("original")
    (folder / "small.toml").write_text(RECIPE)
    trainer = opened(folder, resume=False)
    for _ in range(12):
        trainer.advance()
    assert trainer.best
    return folder


@pytest.fixture
def left(original, tmp_path):
    """A copy of it."""
    return shutil.copytree(original, tmp_path / "copy")


def opened(folder, *, resume=True):
    trainer = Trainer(config.load(folder / "small.toml"), folder / "run", folder, checkpoint_every=1)
    trainer.open(resume)
    return trainer


def only_packed(folder):
    """What a clone of the repository holds."""
    pack(folder / "run")
    (folder / "run" / FILE).unlink()
    (folder / "run" / log.FILE).unlink()


def test_training_goes_on_at_the_same_update_with_a_near_loss_and_its_log(left):
    exact = opened(left)
    before = log.read(left / "run")
    only_packed(left)
    near = opened(left)
    assert near.at == exact.at
    assert near.best_score == exact.best_score
    assert near.enforcer == exact.enforcer
    assert log.read(left / "run") == before
    for trainer in (near, exact):
        trainer.advance()
    for name, loss in exact._losses.items():
        assert near._losses[name] == pytest.approx(loss, rel=0.05, abs=0.01), name
    while not near.finished:
        near.advance()
    assert near.at.total == 13


def test_every_tensor_is_near_what_it_was(left):
    exact = read(left / "run").tensors
    pack(left / "run")
    near = unpack(left / "run").checkpoint.tensors
    assert near.keys() == exact.keys()
    for name, value in exact.items():
        assert near[name].dtype == value.dtype, name
        largest = value.float().abs().amax(-1, keepdim=True) if value.ndim else value
        assert ((near[name] - value).abs() <= 0.01 * largest + 1e-12).all(), name


def test_a_second_moment_never_becomes_smaller(left):
    """The optimiser divides by its root: one that became 0 beside a first moment would throw the weight."""
    exact = read(left / "run").tensors
    pack(left / "run")
    near = unpack(left / "run").checkpoint.tensors
    names = [name for name in exact if name.endswith(packed.SECOND) and exact[name].ndim == 2]
    assert names
    for name in names:
        assert (near[name] >= exact[name] * (1 - 1e-5)).all()


def test_the_whole_checkpoint_goes_first(left):
    pack(left / "run")
    trainer = opened(left)
    trainer.advance()
    assert read(left / "run").facts["at"]["total"] == 13
    assert opened(left).finished


def test_a_run_above_two_megabytes_is_refused(left, monkeypatch):
    monkeypatch.setattr(packed, "BYTES_MAX", 10_000)
    with pytest.raises(PackError, match="MB packed, more than"):
        pack(left / "run")
    assert not (left / "run" / PACKED).exists()


def test_a_run_of_the_shipped_size_fits(tmp_path):
    """Hidden 96, messages of 64, 112 prototypes, a decoder of occupancy: as large as any recipe."""
    recipe = tmp_path / "large.toml"
    recipe.write_text(
        """
        name = "traffic_junction/large"
        task = "traffic_junction/medium"
        seed = 1
        model = { tokens = 112, channel = "prototype", gate = "learned" }
        decoder = { target = "occupancy" }
        check = { every = 1, episodes = 5 }
        [[phase]]
        name = "one"
        updates = 2
        episodes = 2
        decoder_weight = 1.0
        """
    )
    run(recipe, tmp_path / "run", progress=False)
    learner = [value for name, value in read(tmp_path / "run").tensors.items() if name.startswith("learner.")]
    assert sum(value.numel() for value in learner) > 300_000
    assert pack(tmp_path / "run").stat().st_size <= 2_000_000


def test_a_damaged_pack_is_named(left):
    only_packed(left)
    path = left / "run" / PACKED
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(CheckpointError, match=r"resume\.safetensors: damaged"):
        opened(left)


def test_the_command_packs_and_train_goes_on(left):
    (left / "run" / "recipe.toml").write_text(RECIPE)
    packing = CliRunner().invoke(app, ["pack", str(left / "run")])
    assert packing.exit_code == 0
    assert "not bit for bit" in packing.stdout
    (left / "run" / FILE).unlink()
    words = ["train", str(left / "small.toml"), "--out", str(left / "run")]
    refused = CliRunner().invoke(app, words)
    assert refused.exit_code == 2
    assert "holds a run already" in refused.stderr
    done = CliRunner().invoke(app, [*words, "--resume"])
    assert done.exit_code == 0
    assert "13 updates" in done.stdout
    discard_resume(left / "run")
    discard_resume(left / "run")
    assert not (left / "run" / PACKED).exists()


def test_the_command_refuses_a_folder_without_a_checkpoint(tmp_path):
    done = CliRunner().invoke(app, ["pack", str(tmp_path)])
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert "missing" in done.stderr


def test_what_is_kept_is_the_best_not_the_last(left):
    exact = opened(left).best_policy().weights()
    only_packed(left)
    near = opened(left).best_policy().weights()
    for name, value in exact.items():
        assert torch.allclose(near[name], value, atol=2e-3, rtol=1e-3), name
