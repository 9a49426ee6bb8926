"""A policy that was trained elsewhere becomes a bundle: `hatlab import FOLDER NAME`.

The folder holds `policy.toml`, which says what the weights are, and the weights as plain named arrays, in
`weights.safetensors` or `weights.npz` (never pickled). From there on it goes the way of `hatlab release`:
measured on its own weights, lexicon, refusals, card.

    task = "parent_child"          architecture = "gru"         see models/policies/plain.py
    channel = "prototype"          gate = "open"                budget = 1.0
    hidden = 64                    message = 2                  tokens = 9
    seed = 1                       steps_trained = 0
    source = "…"                   supervised_help = "none"     in words, for the card
"""

import tomllib
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from torch import Tensor

from models.envs import registry
from models.policies import bundle
from models.policies.architectures import ARCHITECTURES, StoredPolicy
from models.policies.bundle import BundleError, Manifest, PolicyBundle
from models.policies.recurrent import Architecture
from models.release import EPISODES, manifest_of, publish

DESCRIPTION, SAFETENSORS, NPZ = "policy.toml", "weights.safetensors", "weights.npz"
Size = Annotated[int, Field(ge=1, le=bundle.SIZE_MAX)]
Words = Annotated[str, Field(min_length=1)]


class ForeignError(Exception):
    """The folder cannot be imported. One line: file and reason."""


class Description(BaseModel):
    """What `policy.toml` says; it is kept in the manifest."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    task: str
    """Environment that it plays."""
    architecture: Literal["gru", "recurrent"]
    """Network whose weights these are."""
    channel: Literal["prototype", "one-hot"]
    """What a message is. Prototypes, the codebook, stand among the weights."""
    gate: Literal["open", "learned"]
    """Whether every message is sent."""
    budget: Annotated[float, Field(gt=0, le=1)] = 1.0
    """Share of steps at which it was trained to speak."""
    hidden: Size
    """Width of the network, H."""
    message: Size
    """Floats in a message, D; with one-hot messages the number of tokens."""
    tokens: Size
    """Size of the codebook, K."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of its training."""
    steps_trained: Annotated[int, Field(ge=0)] = 0
    """Environment steps seen in training."""
    source: Words
    """Where it comes from, in words: framework, code, commit."""
    supervised_help: Words
    """What training used besides the reward; none if nothing."""
    warm_start: str | None = None
    """What the weights were started from besides chance."""


def bring(
    folder: Path, name: str, root: Path, episodes: int = EPISODES, lexicon_episodes: int | None = None
) -> PolicyBundle:
    """Write `<root>/<name>` from a folder of foreign weights and load it again.

    Raises:
        ForeignError: description or weights are missing, wrong, or do not fit each other.
        ReleaseError: it is not fit for people; nothing is written then.
    """
    said = describe(folder)
    policy = build(said, weights(folder))
    return publish(folder, _manifest(said, policy, name), policy, root, episodes, lexicon_episodes)


def describe(folder: Path) -> Description:
    """Read and check `policy.toml`."""
    try:
        raw = tomllib.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
        said = Description.model_validate(raw)
    except OSError as error:
        raise ForeignError(f"{DESCRIPTION}: cannot be read ({error.strerror})") from None
    except ValidationError as error:
        raise ForeignError(f"{DESCRIPTION}: {_first(error)}") from None
    except ValueError as error:
        raise ForeignError(f"{DESCRIPTION}: not TOML ({error})") from None
    if said.task not in registry.NAMES:
        raise ForeignError(f"{DESCRIPTION}: {registry.UnknownTaskError(said.task)}")
    return said


def weights(folder: Path) -> dict[str, Tensor]:
    """Read the weights, float32 and finite, whichever of the two files holds them."""
    found = [name for name in (SAFETENSORS, NPZ) if (folder / name).exists()]
    if len(found) != 1:
        raise ForeignError(f"{folder}: holds {len(found)} of {SAFETENSORS} and {NPZ}; exactly one is needed")
    try:
        if found == [SAFETENSORS]:
            return bundle.tensors((folder / SAFETENSORS).read_bytes())
        return _arrays(folder / NPZ)
    except OSError as error:
        raise ForeignError(f"{found[0]}: cannot be read ({error.strerror or error})") from None
    except BundleError as error:
        raise ForeignError(str(error)) from None


def _arrays(path: Path) -> dict[str, Tensor]:
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (ValueError, zipfile.BadZipFile, AttributeError, EOFError):
        raise ForeignError(f"{NPZ}: not a whole file of plain arrays") from None
    for name, values in arrays.items():
        if values.dtype != np.float32:
            raise ForeignError(f"{NPZ}: {name} holds {values.dtype}, expected float32")
        if not np.isfinite(values).all():
            raise ForeignError(f"{NPZ}: {name} holds a number that is not finite (NaN or infinity)")
    return {name: torch.from_numpy(values) for name, values in arrays.items()}


def build(said: Description, stored: Mapping[str, Tensor]) -> StoredPolicy:
    """Make the policy; names and shapes of its weights are checked."""
    env = registry.make(said.task)
    try:
        architecture = Architecture(
            env.observation_size, env.actions, said.hidden, said.message, said.tokens, said.channel, said.gate
        )
        return ARCHITECTURES[said.architecture](architecture, stored)
    except ValueError as error:
        raise ForeignError(f"weights: {error}") from None


def _manifest(said: Description, policy: StoredPolicy, name: str) -> Manifest:
    return manifest_of(
        policy,
        name=name,
        task=said.task,
        budget=said.budget,
        seed=said.seed,
        steps_trained=said.steps_trained,
        warm_start=said.warm_start,
        recipe={"imported": said.model_dump(mode="json")},
        git_commit="not trained here",
        architecture=said.architecture,
    )


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    reason = "unknown key" if first["type"] == "extra_forbidden" else first["msg"]
    return f"{'.'.join(map(str, first['loc']))}: {reason}"
