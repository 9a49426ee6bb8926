"""A training run on disk: one safetensors file, replaced atomically, from which the run goes on bit for bit.

Randomness needs no state: every update draws from generators seeded by (recipe's seed, number of the update).
"""

import json
import os
from pathlib import Path
from typing import Any, NamedTuple

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

FILE = "checkpoint.safetensors"


class CheckpointError(Exception):
    """A checkpoint cannot be read. One line: file and reason."""


class Checkpoint(NamedTuple):
    """Named tensors and everything else as JSON."""

    tensors: dict[str, Tensor]
    facts: dict[str, Any]


def write(folder: Path, tensors: dict[str, Tensor], facts: dict[str, Any]) -> Path:
    """Write, force to disk, then take the old one's place: a kill at any moment leaves a whole file."""
    path, new = folder / FILE, folder / (FILE + ".new")
    save_file(
        {name: tensor.contiguous().clone() for name, tensor in tensors.items()},
        new,
        {"facts": json.dumps(facts)},
    )
    with new.open("rb") as file:
        os.fsync(file.fileno())
    new.replace(path)
    return path


def read(folder: Path) -> Checkpoint:
    """Read the checkpoint of a run's folder.

    Raises:
        CheckpointError: it is missing or damaged.
    """
    path = folder / FILE
    try:
        with safe_open(path, "pt") as file:
            facts = json.loads((file.metadata() or {})["facts"])
            return Checkpoint({name: file.get_tensor(name) for name in file.keys()}, facts)  # noqa: SIM118
    except FileNotFoundError:
        raise CheckpointError(f"{path}: missing; start the run without resuming") from None
    except (SafetensorError, KeyError, ValueError) as error:
        raise CheckpointError(f"{path}: damaged ({error})") from None


def optimiser_tensors(optimiser: torch.optim.Adam) -> dict[str, Tensor]:
    """Adam's state, by number of the parameter."""
    state = optimiser.state_dict()["state"]
    return {f"adam.{number}.{name}": value for number, part in state.items() for name, value in part.items()}


def restore_optimiser(optimiser: torch.optim.Adam, tensors: dict[str, Tensor]) -> None:
    """Put Adam's state back."""
    state: dict[int, dict[str, Tensor]] = {}
    for key, value in part_of(tensors, "adam.").items():
        number, name = key.split(".", 1)
        state.setdefault(int(number), {})[name] = value
    groups = optimiser.state_dict()["param_groups"]
    optimiser.load_state_dict({"state": state, "param_groups": groups})


def part_of(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """Tensors whose names begin with the prefix, without it."""
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}
