"""A training run on disk: one safetensors file, replaced atomically, from which the run goes on bit for bit.

Randomness needs no state: every update draws from generators seeded by (recipe's seed, number of the update).
"""

import json
import os
from pathlib import Path
from typing import Any, NamedTuple

import torch
from safetensors import SafetensorError
from safetensors.torch import load as parse_tensors
from safetensors.torch import save
from torch import Tensor

FILE = "checkpoint.safetensors"
PACKED = "resume.safetensors"
"""A checkpoint made small enough to be committed; see ``models.training.packed``."""


class CheckpointError(Exception):
    """A checkpoint cannot be read. One line: file and reason."""


class Checkpoint(NamedTuple):
    """Named tensors and everything else as JSON."""

    tensors: dict[str, Tensor]
    facts: dict[str, Any]


def write(folder: Path, tensors: dict[str, Tensor], facts: dict[str, Any]) -> Path:
    """Replace the checkpoint of a run's folder.

    Raises:
        OSError: the disk is full or broken; the old checkpoint is still there, whole.
    """
    return store(folder / FILE, serialised(tensors, facts))


def serialised(tensors: dict[str, Tensor], facts: dict[str, Any]) -> bytes:
    """One safetensors file."""
    whole = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()}
    return save(whole, {"facts": json.dumps(facts)})


def store(path: Path, content: bytes) -> Path:
    """Write, force to disk, then take the old one's place: a kill at any moment leaves a whole file."""
    new = path.with_name(path.name + ".new")
    try:
        with new.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    except OSError:
        new.unlink(missing_ok=True)  # a part of a file is of no use, and its room may be needed
        raise
    return path


def read(folder: Path) -> Checkpoint:
    """Read the checkpoint of a run's folder.

    Raises:
        CheckpointError: it is missing or damaged.
    """
    return load(folder / FILE)


def load(path: Path) -> Checkpoint:
    """Read one file; see ``read``. A run may replace it meanwhile."""
    try:
        # safe_open opens it more than once: the header of one checkpoint, the content of another
        content = path.read_bytes()
        return Checkpoint(parse_tensors(content), json.loads(metadata(content)["facts"]))
    except FileNotFoundError:
        raise CheckpointError(f"{path}: missing; start the run without resuming") from None
    except (SafetensorError, KeyError, ValueError) as error:
        raise CheckpointError(f"{path}: damaged ({error})") from None


def metadata(content: bytes) -> dict[str, str]:
    """What a safetensors file says beside its tensors, in its header: eight bytes of length, then JSON."""
    length = int.from_bytes(content[:8], "little")
    header: dict[str, dict[str, str]] = json.loads(content[8 : 8 + length])
    return header.get("__metadata__", {})


def exists(folder: Path) -> bool:
    """Whether the folder holds a run, packed or not."""
    return any((folder / name).exists() for name in (FILE, PACKED))


def discard_resume(folder: Path) -> None:
    """Remove the packed checkpoint of a run that needs it no longer."""
    (folder / PACKED).unlink(missing_ok=True)


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
