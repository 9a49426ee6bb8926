"""The whole application: its routes, the headers on each of them, its health, its schema under fuzzing."""

from dataclasses import replace

import pytest

from server.app import create_app
from server.services.lab import Lab
from server.storage.database import Database
from tests.fakes import fake_lab
from tests.server.web.client import Client
from tests.server.web.walk import client_of


@pytest.fixture(name="lab")
def quick_lab(sqlite_database: Database) -> Lab:
    return fake_lab(sqlite_database)


def test_no_page_tells_strangers_what_addresses_there_are(lab: Lab) -> None:
    client = client_of(lab)
    for path in ("/docs", "/redoc", "/openapi.json"):
        assert client.get(path).status_code == 404


def test_every_route_answers_with_the_security_headers(lab: Lab) -> None:
    app = create_app(lab)
    client = Client(app)
    paths = set(app.openapi()["paths"])
    assert {"/healthz", "/s/{slug}", "/p/{key}", "/p/{key}/step"} <= paths
    for path in sorted(paths):
        for method in ("GET", "POST"):
            response = client.request(method, path.replace("{", "").replace("}", ""))
            assert response.status_code < 500, path
            assert response.headers["x-content-type-options"] == "nosniff"
            assert response.headers["referrer-policy"] == "no-referrer"
            policy = response.headers["content-security-policy"]
            assert "unsafe" not in policy
            assert "frame-ancestors 'none'" in policy


def test_a_healthy_server_says_what_it_has_loaded(lab: Lab) -> None:
    response = client_of(replace(lab, bundle_errors=("x/manifest.json: is no JSON",))).get("/healthz")
    assert response.status_code == 200
    assert response.json() == {
        "ok": True,
        "database": True,
        "migrated": True,
        "bundles": sorted(lab.bundles),
        "bundle_errors": ["x/manifest.json: is no JSON"],
    }


def test_a_server_without_its_database_is_not_healthy(lab: Lab) -> None:
    nowhere = Database("postgresql://nobody@127.0.0.1:1/nothing")
    response = client_of(replace(lab, database=nowhere)).get("/healthz")
    assert response.status_code == 503
    assert response.json()["database"] is False


def test_a_server_whose_database_lacks_a_migration_is_not_healthy(lab: Lab) -> None:
    with lab.database.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '0'")
    response = client_of(lab).get("/healthz")
    assert response.status_code == 503
    assert response.json()["migrated"] is False


def test_the_front_door_says_where_to_go(lab: Lab) -> None:
    response = client_of(lab).get("/")
    assert response.status_code == 200
    assert "link" in response.text
