"""Training puts every tensor where the network is."""

import pytest
import torch

from models.training import config
from models.training.checkpoint import read
from models.training.device import DeviceError, find
from models.training.trainer import Trainer
from tests.models.training.elsewhere import ELSEWHERE, Accelerator, Distant, MixedError
from tests.models.training.small import RECIPE

HELD = """
name = "parent_child/small"
task = "parent_child"
seed = 3
model = { hidden = 8, message = 9, tokens = 9, channel = "one-hot" }
decoder = { target = "location" }
check = { every = 2, episodes = 5 }
[[phase]]
name = "search"
updates = 3
episodes = 4
decoder_weight = 1.0
revive_every = 1
"""


@pytest.fixture
def overwriting():
    """Modules that move get new parameters, as they do between devices that share no memory."""
    torch.__future__.set_overwrite_module_params_on_conversion(True)
    yield
    torch.__future__.set_overwrite_module_params_on_conversion(False)


def trained(folder, text, device):
    recipe = folder / "small.toml"
    recipe.write_text(text)
    trainer = Trainer(config.load(recipe), folder / device.type, folder, device=device)
    trainer.open(resume=False)
    while not trainer.finished:
        trainer.advance()
    return trainer


@pytest.mark.parametrize("text", [RECIPE, HELD], ids=["traffic", "held messages"])
def test_a_run_on_another_device_mixes_no_tensors_and_ends_with_the_same_weights(tmp_path, overwriting, text):
    with Accelerator():
        there = trained(tmp_path, text, ELSEWHERE)
        assert all(isinstance(weight.data, Distant) for weight in there.learner.parameters())
        policy = there.best_policy()
    assert policy.net.encoder.plain.weight.device.type == "cpu"
    here = trained(tmp_path, text, torch.device("cpu"))
    assert there.best_score == here.best_score
    one, other = read(tmp_path / "meta").tensors, read(tmp_path / "cpu").tensors
    assert one.keys() == other.keys()
    assert all(torch.allclose(one[name], other[name], atol=1e-5) for name in one)


def test_the_accelerator_of_this_test_refuses_what_a_real_one_does():
    with Accelerator():
        there = torch.ones(3).to(ELSEWHERE)
        with pytest.raises(MixedError):
            there + torch.ones(3)
        with pytest.raises(MixedError):
            there.numpy()
        assert (there * 2).cpu().numpy().tolist() == [2, 2, 2]
        assert (there + torch.zeros(3, device=ELSEWHERE)).device == ELSEWHERE


@pytest.mark.parametrize("name", ["nonsense", "meta"])
def test_a_device_that_cannot_compute_is_refused_in_one_line(name):
    with pytest.raises(
        DeviceError, match=rf"device '{name}' cannot be used here \(.*\); cpu always can"
    ) as caught:
        find(name)
    assert "\n" not in str(caught.value)
    assert find("cpu") == torch.device("cpu")
