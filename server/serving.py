"""One server from start to stop: check, listen, say where, run uvicorn."""

import socket
from dataclasses import dataclass
from typing import Any

import uvicorn
from uvicorn.supervisors import Multiprocess

from server.domain.errors import BadInputError
from server.services import studies
from server.services.lab import Lab
from server.settings import Settings

KEEP_ALIVE_S = 75  # people think: a shorter one makes most steps pay for a new connection
HEALTH_CHECK_S = 30  # a worker that loads torch on a busy machine is not hung
GRACE_S = 5
BACKLOG = 2048


@dataclass(frozen=True, slots=True)
class Place:
    """Where the server listens."""

    listener: socket.socket
    host: str

    @property
    def url(self) -> str:
        port = self.listener.getsockname()[1]
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{port}"


def serve(settings: Settings, host: str, port: int, workers: int) -> None:
    """Serve until stopped. Each worker opens the lab for itself, from the environment's settings.

    Raises:
        NotReadyError: the database is not ready.
        BadInputError: the port cannot be had.
    """
    lab = Lab.without_agents(settings)
    place = listen(host, port)
    announce(lab, place)
    lab.database.close()
    made = config(settings, "server.app:from_environment", workers)
    if workers == 1:
        uvicorn.Server(made).run([place.listener])
    else:
        place.listener.set_inheritable(True)
        Multiprocess(made, [place.listener]).run()


def listen(host: str, port: int) -> Place:
    """Take the port before anything is announced."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return Place(socket.create_server((host, port), family=family, backlog=BACKLOG), host)
    except OSError as error:
        reason = error.strerror or str(error)
        raise BadInputError(
            f"cannot listen on {host}:{port}: {reason}; choose another --host or --port"
        ) from error


def config(settings: Settings, app: Any, workers: int = 1) -> uvicorn.Config:
    """Uvicorn without access log (paths hold session keys) and without naming itself."""
    return uvicorn.Config(
        app,
        factory=isinstance(app, str),
        workers=workers,
        log_level="warning",
        access_log=False,
        server_header=False,
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=settings.trusted_proxies,
        timeout_keep_alive=KEEP_ALIVE_S,
        timeout_graceful_shutdown=GRACE_S,
        timeout_worker_healthcheck=HEALTH_CHECK_S,
    )


def announce(lab: Lab, place: Place) -> None:
    """The links. Requests wait in the listener until a worker has loaded the agents."""
    url = lab.settings.public_url if "public_url" in lab.settings.model_fields_set else place.url
    with lab.database.reading() as db:
        rows = [study.row for study in studies.every(db) if study.row.status == "open"]
    print(f"hatlab listens on {place.url}")
    for row in rows:
        print(f"  {f'{row.slug} ({row.mode})':<28} {url}/s/{row.slug}")
    print(f"  {'admin':<28} {url}/admin", flush=True)
