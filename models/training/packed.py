"""A checkpoint packed into at most 2 MB, so that a run can be committed and go on elsewhere. Not bit-exact.

Matrices of weights become float16; the best so far is stored as its difference from them, in int8. Adam's
first moment becomes int8 and its second the square root of itself in uint8, rounded up: a step is divided by
it, so that a moment that is small beside its row must not become 0. Each row (of the output of a layer) has
its own scale. Vectors (biases, scales) stay as they are. The log comes along.
"""

import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from models.training import checkpoint, log
from models.training.checkpoint import Checkpoint, CheckpointError

BYTES_MAX = 2_000_000
SCALE, LOG = ".scale", "log"
FIRST, SECOND = ".exp_avg", ".exp_avg_sq"  # torch's names of Adam's moments
_LEARNER, _BEST = "learner.", "best."

Tensors = dict[str, Tensor]


class PackError(Exception):
    """A run cannot be packed. One line: why."""


class Unpacked(NamedTuple):
    """The checkpoint, near to what it was, and ``log.csv`` up to it."""

    checkpoint: Checkpoint
    log: bytes


def pack(folder: Path) -> Path:
    """Write ``resume.safetensors`` from the folder's checkpoint and log.

    Raises:
        CheckpointError: there is no whole checkpoint.
        PackError: it would be larger than 2 MB.
        OSError: it cannot be written.
    """
    held = checkpoint.read(folder)
    logged = (folder / log.FILE).read_bytes()[: held.facts["log_bytes"]]
    tensors = _packed(held.tensors)
    tensors[LOG] = torch.from_numpy(np.frombuffer(zlib.compress(logged, 9), np.uint8).copy())
    content = checkpoint.serialised(tensors, held.facts)
    if len(content) > BYTES_MAX:
        raise PackError(
            f"{folder}: {len(content) / 1e6:.2f} MB packed, more than {BYTES_MAX / 1e6:.0f} MB; "
            "keep its checkpoint elsewhere"
        )
    return checkpoint.store(folder / checkpoint.PACKED, content)


def unpack(folder: Path) -> Unpacked:
    """Read ``resume.safetensors``.

    Raises:
        CheckpointError: it is missing or damaged.
    """
    held = checkpoint.load(folder / checkpoint.PACKED)
    tensors = dict(held.tensors)
    try:
        logged = zlib.decompress(tensors.pop(LOG).numpy().tobytes())
        return Unpacked(Checkpoint(_unpacked(tensors), held.facts), logged)
    except (KeyError, zlib.error) as error:
        raise CheckpointError(f"{folder / checkpoint.PACKED}: damaged ({error})") from None


def _packed(tensors: Tensors) -> Tensors:
    small: Tensors = {}
    for name, value in tensors.items():
        if value.ndim < 2:
            small[name] = value
        elif name.startswith(_LEARNER):
            small[name] = value.half()
        elif name.startswith(_BEST):
            small |= _signed(name, value - tensors[_base(name)].half().float())
        elif name.endswith(FIRST):
            small |= _signed(name, value)
        elif name.endswith(SECOND):
            small |= _rounded_up(name, value.sqrt())
        else:
            raise PackError(f"no way is known to pack {name}")
    return small


def _unpacked(small: Tensors) -> Tensors:
    tensors: Tensors = {}
    for name, value in small.items():
        if name.endswith(SCALE):
            continue
        if value.ndim < 2:
            tensors[name] = value
        elif name.startswith(_LEARNER):
            tensors[name] = value.float()
        else:
            near = value.float() * small[name + SCALE].unsqueeze(1)
            base = small[_base(name)].float() if name.startswith(_BEST) else 0
            tensors[name] = near.square() if name.endswith(SECOND) else near + base
    return tensors


def _base(best: str) -> str:
    """Name of the weight that one of the best is stored as a difference from."""
    return f"{_LEARNER}net.{best.removeprefix(_BEST)}"


def _signed(name: str, value: Tensor) -> Tensors:
    """Rows (R, C) to the nearest of 255 steps between plus and minus their largest magnitude."""
    scale = _scale(value, 127)
    return {name: (value / scale.unsqueeze(1)).round().to(torch.int8), name + SCALE: scale}


def _rounded_up(name: str, value: Tensor) -> Tensors:
    """Rows (R, C) of numbers that are not negative to the next of 255 steps up to their largest."""
    scale = _scale(value, 255)
    steps = (value / scale.unsqueeze(1)).ceil().clamp(max=255)
    return {name: steps.to(torch.uint8), name + SCALE: scale}


def _scale(value: Tensor, steps: int) -> Tensor:
    """(R,) size of a step; 1 for rows of zeros."""
    largest = value.abs().amax(1)
    return torch.where(largest > 0, largest / steps, 1.0)
