"""A released policy on disk: weights, what they are, what their messages mean, how well they do.

A bundle is a folder of five files. `manifest.json` names the sha256 of each of the others, and the sha256 of
the manifest itself is the bundle's; a trial that stores it has named every byte it was played with. Loading
checks all of this before a number is used and never unpickles anything.

Every failure is a `BundleError` of one line: the file and the reason.
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load as parse_tensors
from safetensors.torch import save as tensor_bytes

from models.envs import registry
from models.policies.architectures import ARCHITECTURES, RECURRENT
from models.policies.lexicon import Lexicon, LexiconError
from models.policies.recurrent import Architecture

if TYPE_CHECKING:
    from collections.abc import Mapping

    from models.policies.api import Policy


FORMAT = 1
MANIFEST, WEIGHTS, LEXICON, EVALUATION, CARD = (
    "manifest.json",
    "weights.safetensors",
    "lexicon.json",
    "evaluation.json",
    "CARD.md",
)
HASHED = (WEIGHTS, LEXICON, EVALUATION, CARD)
SIZE_MAX = 4096  # a manifest may not make the loader allocate without limit
BYTES_MAX = 256 * 2**20  # of one file: a link to a device, or a wrong file, must not fill the memory
NAME = re.compile(r"[a-z0-9_]+/[a-z0-9-]+")


class BundleError(Exception):
    """A bundle cannot be used. One line: file and reason."""


@dataclass(frozen=True, slots=True)
class Manifest:
    """What a bundle says about itself.

    Attributes:
        format: version of this file's layout.
        name: `<task folder>/<name>`, unique in an installation.
        task: name of the environment it was trained for.
        task_version: version of that environment's rules.
        channel: what a message is: prototype or one-hot.
        gate: open (every message is sent) or learned.
        budget: share of steps at which an agent was trained to speak, 1 for an open gate.
        sizes: every size from which the shapes of the weights follow (fields of `Architecture`).
        seed: seed of the training.
        steps_trained: environment steps seen in training.
        warm_start: what the weights were started from besides chance; None for nothing.
        recipe: the whole recipe, as read from its TOML.
        git_commit: source that trained it.
        created: UTC, ISO 8601.
        files: sha256 of every other file of the bundle.
        architecture: name of the network (`models.policies.architectures`); written down only if it is not
            `recurrent`, so that the bytes, and with them the hashes, of older bundles stay what they are.
    """

    format: int
    name: str
    task: str
    task_version: int
    channel: str
    gate: str
    budget: float
    sizes: dict[str, int]
    seed: int
    steps_trained: int
    warm_start: str | None
    recipe: dict[str, Any]
    git_commit: str
    created: str
    files: dict[str, str]
    architecture: str = RECURRENT


@dataclass(frozen=True, eq=False)
class PolicyBundle:
    """A policy that was read, checked and built.

    Attributes:
        name: `<task folder>/<name>`.
        manifest: what it says about itself.
        policy: the mind, ready to speak and act.
        lexicon: what its tokens mean.
        evaluation: what `hatlab evaluate` measured when it was released.
        sha256: of manifest.json, and so of everything.
    """

    name: str
    manifest: Manifest
    policy: Policy
    lexicon: Lexicon
    evaluation: dict[str, Any]
    sha256: str


def load(path: Path | str) -> PolicyBundle:
    """Read and check a bundle folder.

    Raises:
        BundleError: anything is missing, foreign, changed or does not fit together.
    """
    folder = Path(path)
    raw = _read(folder, MANIFEST)
    manifest = _manifest(raw)
    files = _files(folder, manifest)
    _check_task(manifest)
    policy = _policy(manifest, files[WEIGHTS])
    lexicon = _lexicon(manifest, files[LEXICON])
    evaluation = _object(EVALUATION, files[EVALUATION])
    return PolicyBundle(manifest.name, manifest, policy, lexicon, evaluation, sha256(raw))


def find(root: Path | str) -> tuple[dict[str, PolicyBundle], tuple[str, ...]]:
    """Load every bundle below a folder; a broken one becomes an error line and stops nothing else.

    Returns:
        The bundles by name, and one line per bundle that could not be loaded.
    """
    root = Path(root)
    bundles: dict[str, PolicyBundle] = {}
    errors: list[str] = []
    for folder in sorted(path for path in root.glob("*/*") if path.is_dir()):
        name = folder.relative_to(root).as_posix()
        try:
            bundles[name] = _load_named(root, name)
        except BundleError as error:
            errors.append(f"{name}/{error}")
    return bundles, tuple(errors)


def _load_named(root: Path, name: str) -> PolicyBundle:
    bundle = load(root / name)
    if bundle.name != name:
        raise BundleError(f"{MANIFEST}: names {bundle.name!r}, but its folder is {name!r}; rename one")
    return bundle


def save(  # one argument for each file
    root: Path | str,
    manifest: Manifest,
    weights: Mapping[str, torch.Tensor],
    lexicon: Lexicon,
    evaluation: Mapping[str, Any],
    card: str,
) -> PolicyBundle:
    """Write a bundle to `<root>/<manifest.name>` and load it again from there.

    `manifest.files` is filled in; files of an older bundle of the same name are replaced.
    """
    folder = Path(root) / manifest.name
    folder.mkdir(parents=True, exist_ok=True)
    contents = {
        WEIGHTS: tensor_bytes(dict(weights)),
        LEXICON: _json_bytes(lexicon.to_json(), indent=None),
        EVALUATION: _json_bytes(evaluation),
        CARD: card.encode(),
    }
    hashes = {name: sha256(content) for name, content in contents.items()}
    said = {**asdict(manifest), "files": hashes}
    if manifest.architecture == RECURRENT:
        del said["architecture"]
    contents[MANIFEST] = _json_bytes(said)
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    return load(folder)


def sha256(content: bytes) -> str:
    """Hexadecimal sha256."""
    return hashlib.sha256(content).hexdigest()


def _json_bytes(data: Mapping[str, Any], indent: int | None = 2) -> bytes:
    text = json.dumps(data, indent=indent, sort_keys=True, ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode()


def _read(folder: Path, name: str) -> bytes:
    path = folder / name
    try:
        if path.exists() and not path.is_file():
            raise BundleError(f"{name}: not a file")  # reading a pipe or a device would never end
        if path.stat().st_size > BYTES_MAX:
            raise BundleError(f"{name}: larger than {BYTES_MAX} bytes")
        return path.read_bytes()
    except FileNotFoundError:
        raise BundleError(f"{name}: missing; copy the whole bundle folder again") from None
    except OSError as error:
        raise BundleError(f"{name}: cannot be read ({error.strerror})") from None


def _object(name: str, raw: bytes) -> dict[str, Any]:
    try:
        data = json.loads(raw)
        json.dumps(data, ensure_ascii=False).encode()  # a lone surrogate cannot be shown on any page
    except (ValueError, RecursionError):
        raise BundleError(f"{name}: not JSON") from None
    if not isinstance(data, dict):
        raise BundleError(f"{name}: not a JSON object")
    return data


def _manifest(raw: bytes) -> Manifest:
    data = _object(MANIFEST, raw)
    if data.get("format") != FORMAT:
        raise BundleError(f"{MANIFEST}: format version {data.get('format')!r}, this hatlab reads {FORMAT}")
    data.setdefault("architecture", RECURRENT)
    names = {field.name for field in fields(Manifest)}
    if names != data.keys():
        odd = ", ".join(sorted(names ^ data.keys()))
        raise BundleError(f"{MANIFEST}: fields missing or unknown: {odd}")
    _check_types(data)
    return Manifest(**data)


def _check_types(data: dict[str, Any]) -> None:
    kinds: dict[type | tuple[type, ...], tuple[str, ...]] = {
        str: ("name", "task", "channel", "gate", "git_commit", "created", "architecture"),
        int: ("format", "task_version", "seed", "steps_trained"),
        (int, float): ("budget",),
        dict: ("sizes", "recipe", "files"),
        (str, type(None)): ("warm_start",),
    }
    for kind, names in kinds.items():
        for name in names:
            if not isinstance(data[name], kind) or isinstance(data[name], bool):
                raise BundleError(f"{MANIFEST}: {name} is {data[name]!r}, which is of the wrong type")
    if not NAME.fullmatch(data["name"]):
        raise BundleError(f"{MANIFEST}: name {data['name']!r} is not of the form task_folder/name-1")
    if not 0 < data["budget"] <= 1:
        raise BundleError(f"{MANIFEST}: budget is {data['budget']}, a share above 0 and at most 1 is needed")
    if not all(type(value) is int and value >= 0 for value in data["sizes"].values()):
        raise BundleError(f"{MANIFEST}: sizes must be whole numbers of 0 or more")


def _files(folder: Path, manifest: Manifest) -> dict[str, bytes]:
    if manifest.files.keys() != set(HASHED):
        raise BundleError(f"{MANIFEST}: files must name {', '.join(HASHED)} and nothing else")
    foreign = sorted({path.name for path in folder.iterdir()} - {MANIFEST, *HASHED})
    if foreign:
        raise BundleError(f"{foreign[0]}: foreign file, not named by the manifest; remove it")
    contents = {name: _read(folder, name) for name in HASHED}
    for name, content in contents.items():
        if sha256(content) != manifest.files[name]:
            raise BundleError(f"{name}: sha256 is not the one in the manifest; changed or cut short")
    return contents


def _check_task(manifest: Manifest) -> None:
    try:
        env = registry.make(manifest.task)
    except registry.UnknownTaskError as error:
        raise BundleError(f"{MANIFEST}: {error}") from None
    if manifest.task_version != env.version:
        raise BundleError(
            f"{MANIFEST}: trained for version {manifest.task_version} of {manifest.task}, "
            f"this hatlab plays version {env.version}"
        )
    for name, size in {"observation_size": env.observation_size, "actions": env.actions}.items():
        if manifest.sizes.get(name) != size:
            found = manifest.sizes.get(name)
            raise BundleError(f"{MANIFEST}: {name} is {found}, but {manifest.task} has {size}")


def _architecture(manifest: Manifest) -> Architecture:
    if manifest.architecture not in ARCHITECTURES:
        known = ", ".join(ARCHITECTURES)
        raise BundleError(f"{MANIFEST}: unknown architecture {manifest.architecture!r}; known ones: {known}")
    if manifest.channel not in ("prototype", "one-hot"):
        raise BundleError(
            f"{MANIFEST}: channel {manifest.channel!r} has no tokens; prototype or one-hot needed"
        )
    if max(manifest.sizes.values(), default=0) > SIZE_MAX:
        raise BundleError(f"{MANIFEST}: a size is above {SIZE_MAX}")
    try:
        return Architecture(**manifest.sizes, channel=manifest.channel, gate=manifest.gate)
    except (TypeError, ValueError) as error:
        raise BundleError(f"{MANIFEST}: sizes or gate cannot be ({_line(error)})") from None


def _policy(manifest: Manifest, raw: bytes) -> Policy:
    architecture = _architecture(manifest)
    try:
        return ARCHITECTURES[manifest.architecture](architecture, tensors(raw))
    except ValueError as error:
        raise BundleError(f"{WEIGHTS}: {_line(error)}") from None


def tensors(raw: bytes) -> dict[str, torch.Tensor]:
    """Return the weights of a safetensors file by name.

    Raises:
        BundleError: it is cut short, not float32 or not finite.
    """
    try:
        weights: dict[str, torch.Tensor] = parse_tensors(raw)
    except (SafetensorError, KeyError, ValueError) as error:
        raise BundleError(f"{WEIGHTS}: not a whole safetensors file ({_line(error)})") from None
    for name, tensor in weights.items():
        if tensor.dtype != torch.float32:
            raise BundleError(f"{WEIGHTS}: {name} holds {tensor.dtype}, expected float32")
        if not bool(torch.isfinite(tensor).all()):
            raise BundleError(f"{WEIGHTS}: {name} holds a number that is not finite (NaN or infinity)")
    return weights


def _lexicon(manifest: Manifest, raw: bytes) -> Lexicon:
    try:
        lexicon = Lexicon.from_json(_object(LEXICON, raw))
    except LexiconError as error:
        raise BundleError(f"{LEXICON}: {error}") from None
    except (TypeError, ValueError, KeyError, OverflowError) as error:
        raise BundleError(f"{LEXICON}: a value of the wrong type ({_line(error)})") from None
    wanted = manifest.sizes["tokens"], registry.make(manifest.task).cells
    if (lexicon.tokens, lexicon.cells) != wanted:
        found = lexicon.tokens, lexicon.cells
        raise BundleError(f"{LEXICON}: (tokens, cells) is {found}, weights and task have {wanted}")
    return lexicon


def _line(error: Exception) -> str:
    """Return the first line of an error's text."""
    return str(error.args[0] if error.args else error).strip().split("\n", maxsplit=1)[0]
