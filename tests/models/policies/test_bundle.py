import json
import os
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save as tensor_bytes

from models.policies import bundle as bundles
from models.policies.bundle import BundleError, PolicyBundle, find, load
from tests.models.policies.bundles import (
    NAME,
    replace_file,
    rewrite_manifest,
    tiny_bundle,
    tiny_lexicon,
    tiny_policy,
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    tiny_bundle(tmp_path)
    return tmp_path / NAME


def refusal(folder: Path) -> str:
    with pytest.raises(BundleError) as caught:
        load(folder)
    line = str(caught.value)
    assert "\n" not in line
    return line


def test_a_bundle_comes_back_as_it_was_saved(folder: Path) -> None:
    bundle = load(folder)
    rows = np.zeros((3, bundle.policy.hidden_size), np.float32)
    seen = np.random.default_rng(0).random((3, 9 * 85)).astype(np.float32)
    said, expected = bundle.policy.speak(rows, seen), tiny_policy().speak(rows, seen)
    assert np.array_equal(said.token, expected.token)
    assert np.array_equal(said.message, expected.message)
    assert np.array_equal(bundle.lexicon.probability, tiny_lexicon().probability)
    assert bundle.evaluation == {"episodes": 0}
    assert (bundle.name, bundle.manifest.task) == (NAME, "parent_child")


def test_the_sha256_of_a_bundle_is_that_of_its_manifest_and_follows_every_byte(folder: Path) -> None:
    before = load(folder).sha256
    assert before == bundles.sha256((folder / "manifest.json").read_bytes())
    replace_file(folder, "CARD.md", b"# tiny, and again\n")
    assert load(folder).sha256 != before


@pytest.mark.parametrize("name", [bundles.MANIFEST, *bundles.HASHED])
def test_a_missing_file_is_named(folder: Path, name: str) -> None:
    (folder / name).unlink()
    assert refusal(folder).startswith(f"{name}: missing")


def test_a_folder_that_does_not_exist_has_no_manifest(tmp_path: Path) -> None:
    assert refusal(tmp_path / "nowhere").startswith("manifest.json: missing")


@pytest.mark.parametrize("name", bundles.HASHED)
def test_one_changed_byte_is_noticed_in_every_file(folder: Path, name: str) -> None:
    content = bytearray((folder / name).read_bytes())
    content[len(content) // 2] ^= 1
    (folder / name).write_bytes(bytes(content))
    assert refusal(folder).startswith(f"{name}: sha256 is not the one in the manifest")


def test_a_foreign_file_is_named(folder: Path) -> None:
    (folder / "weights.pt").write_bytes(b"")
    assert refusal(folder).startswith("weights.pt: foreign file")


def test_files_of_another_bundle_do_not_pass(tmp_path: Path) -> None:
    tiny_bundle(tmp_path)
    other = tiny_bundle(tmp_path, name="parent_child/other-9", channel="one-hot")
    shutil.copy(tmp_path / other.name / "weights.safetensors", tmp_path / NAME)
    assert refusal(tmp_path / NAME).startswith("weights.safetensors: sha256")


def test_truncated_weights_are_refused_even_when_the_manifest_vouches_for_them(folder: Path) -> None:
    content = (folder / "weights.safetensors").read_bytes()
    for length in (0, 4, 50, len(content) - 1):
        replace_file(folder, "weights.safetensors", content[:length])
        assert refusal(folder).startswith("weights.safetensors: not a whole safetensors file")


class Bomb:
    def __reduce__(self) -> tuple[object, ...]:
        return (pytest.fail, ("a bundle was unpickled",))


def test_a_pickle_is_never_opened(folder: Path) -> None:
    replace_file(folder, "weights.safetensors", pickle.dumps(Bomb()))
    assert refusal(folder).startswith("weights.safetensors: not a whole safetensors file")


def spoilt(change: str) -> bytes:
    weights = tiny_policy().weights()
    first = min(weights)
    match change:
        case "wrong shape":
            weights[first] = torch.zeros(1, 1)
        case "missing":
            del weights[first]
        case "unknown":
            weights["extra"] = torch.zeros(1)
        case "nan":
            weights[first] = torch.full_like(weights[first], float("nan"))
        case "double":
            weights[first] = weights[first].double()
    return tensor_bytes(weights)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("wrong shape", "has shape (1, 1), not"),
        ("missing", "is missing or unknown"),
        ("unknown", "extra is missing or unknown"),
        ("nan", "holds a number that is not finite"),
        ("double", "holds torch.float64, expected float32"),
    ],
)
def test_weights_that_do_not_fit_are_refused(folder: Path, change: str, reason: str) -> None:
    replace_file(folder, "weights.safetensors", spoilt(change))
    line = refusal(folder)
    assert line.startswith("weights.safetensors: ")
    assert reason in line


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("format", 2, "format version 2, this hatlab reads 1"),
        ("format", None, "format version None"),
        ("task", "chess", "unknown task 'chess'"),
        ("task", "traffic_junction/medium", "observation_size is 765"),
        ("task", 3, "task is 3, which is of the wrong type"),
        ("task_version", 99, "trained for version 99 of parent_child"),
        ("name", "../../etc", "is not of the form"),
        ("channel", "continuous", "channel 'continuous' has no tokens"),
        ("gate", "ajar", "gate is 'ajar'"),
        ("architecture", "mlp", "unknown architecture 'mlp'; known ones: recurrent, gru"),
        ("architecture", None, "architecture is None, which is of the wrong type"),
        ("budget", "all", "budget is 'all'"),
        ("budget", 2.0, "budget is 2.0"),
        ("seed", True, "seed is True"),
        ("sizes", {}, "observation_size is None"),
        ("sizes", {"observation_size": 765, "actions": 5}, "sizes or gate cannot be"),
        ("sizes", {"observation_size": 765, "actions": 5, "hidden": 10**9}, "a size is above"),
        ("sizes", {"observation_size": -1}, "sizes must be whole numbers"),
        ("files", {}, "files must name"),
    ],
)
def test_a_manifest_that_cannot_be_is_refused(folder: Path, field: str, value: object, reason: str) -> None:
    rewrite_manifest(folder, lambda data: data.update({field: value}))
    line = refusal(folder)
    assert line.startswith("manifest.json: ")
    assert reason in line


def test_a_manifest_with_a_field_too_few_or_too_many_is_refused(folder: Path) -> None:
    rewrite_manifest(folder, lambda data: data.pop("recipe"))
    assert "missing or unknown: recipe" in refusal(folder)
    rewrite_manifest(folder, lambda data: data.update(recipe={}, mood="good"))
    assert "missing or unknown: mood" in refusal(folder)


def test_a_manifest_that_names_no_network_means_the_recurrent_one(folder: Path) -> None:
    assert "architecture" not in json.loads((folder / bundles.MANIFEST).read_text())
    assert load(folder).manifest.architecture == "recurrent"
    rewrite_manifest(folder, lambda data: data.update(architecture="gru"))
    assert "weights do not fit the architecture" in refusal(folder)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe"])
def test_a_manifest_that_is_no_json_object_is_refused(folder: Path, content: bytes) -> None:
    (folder / "manifest.json").write_bytes(content)
    assert refusal(folder).startswith("manifest.json: not")


def test_a_lexicon_of_another_policy_is_refused(folder: Path) -> None:
    data = tiny_lexicon("traffic_junction/easy").to_json()
    replace_file(folder, "lexicon.json", json.dumps(data).encode())
    assert "lexicon.json: (tokens, cells) is (9, 49), weights and task have (9, 81)" in refusal(folder)


def test_a_lexicon_that_contradicts_itself_is_refused(folder: Path) -> None:
    data = tiny_lexicon().to_json()
    data["probability"][0][0] += 0.5
    replace_file(folder, "lexicon.json", json.dumps(data).encode())
    assert refusal(folder) == "lexicon.json: probability has a row that does not sum to 1"


def test_find_loads_what_it_can_and_says_what_it_could_not(tmp_path: Path) -> None:
    good = tiny_bundle(tmp_path)
    tiny_bundle(tmp_path, name="parent_child/broken-9")
    (tmp_path / "parent_child/broken-9/CARD.md").unlink()
    shutil.copytree(tmp_path / NAME, tmp_path / "parent_child/copied-9")
    loaded, errors = find(tmp_path)
    assert list(loaded) == [NAME]
    assert isinstance(loaded[NAME], PolicyBundle)
    assert loaded[NAME].sha256 == good.sha256
    assert errors[0].startswith("parent_child/broken-9/CARD.md: missing")
    assert errors[1].startswith("parent_child/copied-9/manifest.json: names 'parent_child/tiny-9'")
    assert len(errors) == 2


def test_find_of_a_folder_that_does_not_exist_is_empty(tmp_path: Path) -> None:
    assert find(tmp_path / "nowhere") == ({}, ())


@pytest.mark.parametrize("name", [bundles.MANIFEST, bundles.LEXICON, bundles.EVALUATION])
@pytest.mark.parametrize("content", [b"[" * 200_000, b'{"a":' * 200_000, b'{"a": "\\ud800"}'])
def test_json_that_no_reader_survives_is_refused(folder: Path, name: str, content: bytes) -> None:
    if name == bundles.MANIFEST:
        (folder / name).write_bytes(content)
    else:
        replace_file(folder, name, content)
    assert refusal(folder) == f"{name}: not JSON"


@pytest.mark.parametrize("value", [None, True, 5, "x", {}, [None], [[True, None]]])
@pytest.mark.parametrize("field", ["probability", "uses", "entropy_bits", "null", "positions", "coordinates"])
def test_a_lexicon_of_wrong_types_is_refused_in_one_line(folder: Path, field: str, value: object) -> None:
    lexicon = json.loads((folder / bundles.LEXICON).read_text())
    replace_file(folder, bundles.LEXICON, json.dumps(lexicon | {field: value}).encode())
    assert refusal(folder).startswith(f"{bundles.LEXICON}: ")


def test_a_pipe_in_place_of_a_file_does_not_hold_the_server_up(folder: Path) -> None:
    (folder / bundles.CARD).unlink()
    os.mkfifo(folder / bundles.CARD)
    assert refusal(folder) == f"{bundles.CARD}: not a file"


def test_a_device_in_place_of_a_file_is_not_read(folder: Path) -> None:
    (folder / bundles.MANIFEST).unlink()
    (folder / bundles.MANIFEST).symlink_to("/dev/zero")
    assert refusal(folder) == f"{bundles.MANIFEST}: not a file"


def test_a_file_that_would_fill_the_memory_is_not_read(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bundles, "BYTES_MAX", 10)
    assert refusal(folder) == f"{bundles.MANIFEST}: larger than 10 bytes"
