from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

from models.policies.api import GeneratorDraws
from models.policies.plain import PlainPolicy, shapes
from models.policies.recurrent import Architecture
from models.policies.serving import serving

SMALL = Architecture(7, 3, 6, 4, 5, "prototype", "learned")


def plain(architecture: Architecture = SMALL, seed: int = 0) -> PlainPolicy:
    torch.manual_seed(seed)
    weights = {name: torch.randn(shape) for name, shape in shapes(architecture).items()}
    return PlainPolicy.from_weights(architecture, weights)


def rows(architecture: Architecture, count: int = 11) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    draw = np.random.default_rng(3)
    sizes = architecture.hidden + architecture.message, architecture.observation_size, architecture.message
    hidden, seen, inbox = (draw.normal(size=(count, size)).astype(np.float32) for size in sizes)
    return hidden, seen, inbox


def test_the_equations_are_those_of_torch() -> None:
    mind, (hidden, seen, inbox) = plain(), rows(SMALL)
    weights = mind.weights()
    cell = nn.GRUCell(SMALL.observation_size + SMALL.message, SMALL.hidden)
    cell.load_state_dict({n.removeprefix("gru."): t for n, t in weights.items() if n.startswith("gru.")})
    layer = {
        name: lambda x, name=name: x @ weights[f"{name}.weight"].T + weights[f"{name}.bias"]
        for name in ("speech", "gate", "think", "act")
    }
    h, heard = torch.from_numpy(hidden).split([SMALL.hidden, SMALL.message], 1)
    h = cell(torch.cat((torch.from_numpy(seen), heard), 1), h)
    token = torch.cdist(layer["speech"](h), weights["codebook"]).argmin(1)
    logits = layer["act"](layer["think"](torch.cat((h, torch.from_numpy(inbox)), 1)).relu())

    said = mind.speak(hidden, seen)
    action, memory = mind.act(said.hidden, inbox)
    assert np.allclose(said.hidden[:, : SMALL.hidden], h.detach().numpy(), atol=1e-5)
    assert said.token.tolist() == token.tolist()
    assert said.gate.tolist() == (layer["gate"](h)[:, 0] >= 0).tolist()
    assert np.array_equal(said.message, weights["codebook"].numpy()[token])
    assert action.tolist() == logits.argmax(1).tolist()
    assert np.array_equal(memory[:, SMALL.hidden :], inbox)
    assert len(set(action.tolist())) > 1
    assert 0 < said.gate.mean() < 1


def test_names_without_geometry_are_the_largest_of_raw_and_an_open_gate_is_open() -> None:
    architecture = replace(SMALL, channel="one-hot", message=5, gate="open")
    mind, (hidden, seen, _) = plain(architecture), rows(architecture)
    said = mind.speak(hidden, seen)
    assert said.gate.all()
    assert np.array_equal(said.message, np.eye(5, dtype=np.float32)[said.token])
    assert not mind.vector(np.array([-1], np.int32)).any()


@pytest.mark.parametrize("channel", ["prototype", "one-hot"])
def test_drawn_behaviour_has_the_frequencies_of_the_logits(channel: str) -> None:
    architecture = replace(SMALL, channel=channel, message=5)
    mind, draws = plain(architecture), GeneratorDraws(1)
    hidden, seen, inbox = (np.repeat(part, 4_000, 0) for part in rows(architecture, 1))
    said = mind.speak(hidden, seen, draws)
    action, _ = mind.act(said.hidden, inbox, draws)
    weights = {name: tensor.numpy() for name, tensor in mind.weights().items()}
    state = said.hidden[0, : architecture.hidden]
    logit = float(weights["gate.weight"][0] @ state + weights["gate.bias"][0])
    think = np.maximum(weights["think.weight"] @ np.concatenate((state, inbox[0])) + weights["think.bias"], 0)
    logits = torch.from_numpy(weights["act.weight"] @ think + weights["act.bias"])
    assert abs(said.gate.mean() - 1 / (1 + np.exp(-logit))) < 0.03
    assert np.abs(np.bincount(action, minlength=3) / 4_000 - logits.softmax(0).numpy()).max() < 0.03
    assert (len(set(said.token.tolist())) > 1) == (channel == "one-hot")


def test_what_is_quick_already_is_served_as_it_is() -> None:
    mind = plain()
    assert serving(mind) is mind


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"channel": "continuous", "tokens": 0}, "has tokens"),
        ({"channel": "one-hot"}, "as long as the codebook"),
    ],
)
def test_sizes_that_cannot_be_are_refused(change: dict[str, object], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        shapes(replace(SMALL, **change))
