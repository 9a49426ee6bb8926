"""The play API under what its own schema allows and what it forbids (schemathesis).

What a schema allows need not be accepted: rt_ms must be response_ms - onset_ms, and an integer has no point.
"""

import json
from pathlib import Path
from typing import Any

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from schemathesis import Case, GenerationMode
from schemathesis.specs.openapi.checks import positive_data_acceptance

from server.app import create_app
from server.storage.database import Database
from tests.fakes import fake_lab
from tests.server.services.steps import open_round, playing
from tests.server.web.client import Client


def sent(client: Client, case: Case) -> httpx.Response:
    """The answer to a case, whose body may be any JSON, or bytes that are none."""
    body = case.body if isinstance(case.body, bytes) else json.dumps(case.body).encode()
    headers = {**case.headers, "content-type": case.media_type or "application/json"}
    return client.request("POST", case.formatted_path, content=body, headers=headers, params=case.query)


PATHS = ("/p/{key}/round", "/p/{key}/step")


@pytest.fixture(name="server", scope="module")
def server_with_somebody_playing(
    migrated_sqlite: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Client, str, Any]:
    path = tmp_path_factory.mktemp("fuzz") / "h.sqlite3"
    path.write_bytes(migrated_sqlite.read_bytes())
    lab = fake_lab(Database(f"sqlite:///{path}"))
    key = playing(lab, "traffic-junction")
    open_round(lab, key)
    app = create_app(lab)
    return Client(app), key, schemathesis.openapi.from_dict(app.openapi())


@pytest.mark.parametrize("mode", [GenerationMode.POSITIVE, GenerationMode.NEGATIVE])
@pytest.mark.parametrize("path", PATHS)
def test_the_play_api_answers_as_its_schema_says(
    server: tuple[Client, str, Any], path: str, mode: GenerationMode
) -> None:
    client, key, schema = server
    cases = schema[path]["POST"].as_strategy(generation_mode=mode)

    @settings(max_examples=25, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(cases, st.booleans())
    def run(case: Case, known: bool) -> None:
        if known:
            case.path_parameters["key"] = key
        case.validate_response(sent(client, case), excluded_checks=[positive_data_acceptance])

    run()
