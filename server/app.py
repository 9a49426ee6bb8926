"""The one composition root: settings, database and bundles in, an ASGI application out."""

import multiprocessing
import os
import re
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import structlog
import torch
from fastapi import FastAPI
from fastapi.middleware import Middleware
from fastapi.telemetry import TelemetryConfig

from server.services.lab import Lab
from server.settings import Settings
from server.web import admin, entry, errors, health, hooks, participant, play_api
from server.web.security import BodyLimit, SecurityHeaders
from server.web.static import VersionedFiles

# Nobody is watched beyond the log.
NO_TELEMETRY: TelemetryConfig = {"tracing": False, "metrics": False, "logs": False}


def create_app(lab: Lab) -> FastAPI:
    """The server over an opened lab, which it closes at the end."""

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        lab.database.close()

    app = FastAPI(
        title="hatlab",
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        telemetry=NO_TELEMETRY,
        lifespan=lifespan,
        middleware=[
            Middleware(SecurityHeaders, behind_https=lab.settings.behind_https),
            Middleware(errors.Incidents),
            Middleware(BodyLimit, body_max_bytes=lab.settings.body_max_bytes),
        ],
    )
    app.state.lab = lab
    errors.install(app)
    for router in (
        play_api.router,
        entry.router,
        participant.router,
        health.router,
        hooks.router,
        admin.router,
    ):
        app.include_router(router)
    app.mount("/static", VersionedFiles())
    return app


def from_environment() -> FastAPI:
    """The application of one worker: what `uvicorn` calls as a factory.

    Agents that cannot be loaded are named on stderr, one line each, and left out.
    """
    log_as_json()
    torch.set_num_threads(1)  # one decision is too small to share; workers are what share the load
    stay_on_one_core()
    lab = Lab.open(Settings())
    for error in lab.bundle_errors:
        print(f"hatlab: agent left out: {error}", file=sys.stderr)
    return create_app(lab)


def stay_on_one_core() -> None:
    """Keep the threads of a worker together, each worker on the next core.

    Python runs one of them at a time in any case; passing the turn from core to core costs more than the work
    itself (measured: 3.6 ms CPU a step with 40 threads on two cores, 1.3 ms on one).
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    number = re.search(r"\d+$", multiprocessing.current_process().name)  # uvicorn's: SpawnProcess-1, -2, …
    worker = int(number[0]) if number else 0
    os.sched_setaffinity(0, {cores[(os.getppid() + worker) % len(cores)]})


def log_as_json() -> None:
    """One JSON object a line on stderr."""
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True, key="at"),
            structlog.processors.JSONRenderer(sort_keys=True),
        ],
        logger_factory=structlog.WriteLoggerFactory(file=sys.stderr),
    )
