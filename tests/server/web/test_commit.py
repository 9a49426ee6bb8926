"""The commit comes before the answer: a real server, a socket, and a commit that is held back."""

import http.client
import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from urllib.parse import urlencode

import pytest
import uvicorn

from server.app import create_app
from server.services.lab import Lab
from server.serving import config
from server.storage import participants
from server.storage.database import Database, DbSession
from tests.fakes import definition, fake_lab, timing
from tests.server.services.steps import launch, open_round, playing
from tests.server.web.walk import YES, prolific

HELD_S = 0.4


class HeldDatabase(Database):
    """Commits only once it is told to."""

    def __init__(self, url: str) -> None:
        super().__init__(url)
        self.reached = threading.Event()
        self.released = threading.Event()

    @contextmanager
    def writing(self) -> Iterator[DbSession]:
        with super().writing() as db:
            yield db
            self.reached.set()
            assert self.released.wait(20)


@pytest.fixture(name="lab")
def lab_of_a_database(sqlite_database: Database) -> Lab:
    return fake_lab(sqlite_database)


@contextmanager
def server_of(lab: Lab) -> Iterator[int]:
    """A real server in a thread; its port."""
    listener = socket.create_server(("127.0.0.1", 0))
    server = uvicorn.Server(config(lab.settings, create_app(lab)))
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    try:
        yield listener.getsockname()[1]
    finally:
        server.should_exit = True
        thread.join(20)


def request_bytes(path: str, body: str, kind: str) -> bytes:
    head = f"POST {path} HTTP/1.1\r\nHost: hatlab.test\r\nContent-Type: {kind}\r\n"
    return f"{head}Content-Length: {len(body)}\r\n\r\n{body}".encode()


def assert_nothing_comes_before_the_commit(lab: Lab, request: bytes) -> http.client.HTTPResponse:
    """The answer, of which no byte came while the commit was held."""
    held = HeldDatabase(lab.database.url.render_as_string(hide_password=False))
    with (
        server_of(replace(lab, database=held)) as port,
        socket.create_connection(("127.0.0.1", port)) as connection,
    ):
        connection.sendall(request)
        assert held.reached.wait(20)
        connection.settimeout(HELD_S)
        with pytest.raises(TimeoutError):
            connection.recv(1)
        connection.settimeout(20)
        held.released.set()
        response = http.client.HTTPResponse(connection)
        response.begin()
        response.read()
        return response


def test_no_byte_of_a_step_is_sent_before_it_is_durable(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    open_round(lab, key)
    body = json.dumps({"round": 1, "seq": 1, "action": 0, "timing": dict(timing())})
    request = request_bytes(f"/p/{key}/step", body, "application/json")
    assert assert_nothing_comes_before_the_commit(lab, request).status == 200


def test_no_byte_of_a_round_is_sent_before_it_is_durable(lab: Lab) -> None:
    key = playing(lab, "traffic-junction")
    request = request_bytes(f"/p/{key}/round", '{"after":null}', "application/json")
    assert assert_nothing_comes_before_the_commit(lab, request).status == 200


def test_nobody_is_sent_on_before_the_consent_is_durable(lab: Lab) -> None:
    launch(lab, definition("traffic-junction"))
    body = urlencode({**prolific(), **YES})
    request = request_bytes("/s/traffic-junction/consent", body, "application/x-www-form-urlencoded")
    response = assert_nothing_comes_before_the_commit(lab, request)
    assert response.status == 303
    with lab.database.reading() as db:
        assert len(list(participants.stream(db))) == 1


def test_the_server_does_not_say_what_it_is(lab: Lab) -> None:
    with server_of(lab) as port:
        connection = http.client.HTTPConnection("127.0.0.1", port)
        connection.request("GET", "/healthz")
        response = connection.getresponse()
        assert response.status == 200
        assert response.getheader("server") is None
        connection.close()
