from pathlib import Path

import pytest

from server.domain.errors import NotReadyError
from server.services.lab import Lab, prepare
from server.settings import Settings
from server.storage.database import Database
from tests.fakes import fake_lab


def settings(folder: Path, **changes: object) -> Settings:
    return Settings(database_url=f"sqlite:///{folder}/lab.sqlite3", bundles=folder, **changes)  # type: ignore[arg-type]


def test_a_prepared_installation_keeps_its_secret(tmp_path: Path) -> None:
    prepare(settings(tmp_path))
    first = Lab.open(settings(tmp_path))
    prepare(settings(tmp_path))
    second = Lab.open(settings(tmp_path))
    assert first.secret_key == second.secret_key
    assert len(first.secret_key) >= 40
    own = Lab.open(settings(tmp_path, secret_key="mine"))
    assert own.secret_key == "mine"
    for lab in (first, second, own):
        lab.database.close()


def test_an_installation_that_is_not_prepared_is_refused_with_the_command_to_run(tmp_path: Path) -> None:
    with pytest.raises(NotReadyError, match="hatlab init"):
        Lab.open(settings(tmp_path))


def test_an_agent_that_is_not_loaded_is_named(sqlite_database: Database) -> None:
    lab = fake_lab(sqlite_database)
    assert lab.agent("parent_child/onehot-9").name == "parent_child/onehot-9"
    with pytest.raises(NotReadyError, match="parent_child/nobody"):
        lab.agent("parent_child/nobody")
    with pytest.raises(NotReadyError, match="sha256 0000"):
        lab.agent("parent_child/onehot-9", "0000")


def test_secrets_are_not_shown_and_empty_ones_are_none(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("HATLAB_SECRET_KEY", "do not print me")
    monkeypatch.setenv("HATLAB_ADMIN_PASSWORD", "")
    read = Settings()
    assert "do not print me" not in repr(read)
    assert read.admin_password is None


def test_links_begin_with_an_address(tmp_path: Path) -> None:
    assert settings(tmp_path, public_url="https://lab.example/").public_url == "https://lab.example"
    assert settings(tmp_path, public_url="http://10.0.0.1:80/lab/").public_url == "http://10.0.0.1:80/lab"
    for wrong in ("lab.example", "ftp://lab.example", "https://", "https://lab.example?a=1", ""):
        with pytest.raises(ValueError, match="use an address like"):
            settings(tmp_path, public_url=wrong)


def test_settings_are_frozen(tmp_path: Path) -> None:
    with pytest.raises(ValueError):
        settings(tmp_path).trial_cache = 5  # type: ignore[misc]


def test_an_external_id_is_hashed_with_the_secret_and_the_marketplace(sqlite_database: Database) -> None:
    lab = fake_lab(sqlite_database)
    hashes = {lab.external_hash(m, n) for m in ("prolific", "mturk") for n in ("a", "b")}
    assert len(hashes) == 4
    assert all(h != "a" and len(h) == 64 for h in hashes)
