"""Static files: for ever under this version's address, asked for anew elsewhere; none from outside."""

import pytest
from starlette.applications import Starlette

from server.web.rendering import static_url
from server.web.static import VersionedFiles
from tests.server.web.client import Client


@pytest.fixture(name="client", scope="module")
def client_of_the_files() -> Client:
    app = Starlette()
    app.mount("/static", VersionedFiles())
    return Client(app)


def test_a_file_of_this_version_is_kept_for_ever(client: Client) -> None:
    response = client.get(static_url("css/hatlab.css"))
    assert response.status_code == 200
    assert response.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert response.headers["content-type"].startswith("text/css")


@pytest.mark.parametrize("path", ["/static/css/hatlab.css", "/static/v-000000000000/css/hatlab.css"])
def test_a_file_of_no_or_another_version_is_found_and_asked_for_anew(client: Client, path: str) -> None:
    response = client.get(path)
    assert response.headers["cache-control"] == "no-cache"
    again = client.get(path, headers={"if-none-match": response.headers["etag"]})
    assert again.status_code == 304


@pytest.mark.parametrize(
    "path", ["/static/../pyproject.toml", "/static/%2e%2e/pyproject.toml", "/static/v-000000000000/../../a"]
)
def test_nothing_outside_the_folder_is_served(client: Client, path: str) -> None:
    assert client.get(path).status_code == 404


def test_a_file_that_is_not_there_is_not_found(client: Client) -> None:
    assert client.get(static_url("css/nothing.css")).status_code == 404
