"""A hatlab of its own for browser tests: small untrained agents, short studies, a real server process."""

import os
import socket
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx
import numpy as np

from benchmarks.rounds_only import ROUNDS_ONLY
from models.envs import registry
from models.policies import bundle
from models.policies.lexicon import Lexicon
from server.domain import study
from server.services import studies
from server.services.lab import Lab
from server.settings import Settings
from tests.e2e.journeys import PROLIFIC, WHOLE
from tests.models.policies.bundles import TOKENS, tiny_manifest, tiny_policy

ROOT = Path(__file__).parents[2]
HATLAB = (str(Path(sys.executable).with_name("hatlab")),)
READY_S = 180

AGENTS = {
    "parent_child/prototype-9": ("parent_child", "prototype"),
    "parent_child/onehot-9": ("parent_child", "one-hot"),
    "traffic_junction/budget-100": ("traffic_junction/medium", "prototype"),
}
SHORT = {
    "parent-child": {"slug": "short-parent-child", "trials_per_block": 2, "step_limit": 8},
    "traffic-junction": {"slug": "short-traffic", "trials_per_block": 3, "step_limit": 20},
}


@dataclass(frozen=True)
class Laboratory:
    folder: Path
    url: str
    environment: dict[str, str]

    @property
    def database(self) -> Path:
        return self.folder / "hatlab.sqlite3"

    def hatlab(self, *words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            (*HATLAB, *words), env=self.environment, cwd=ROOT, capture_output=True, text=True, check=False
        )


@contextmanager
def laboratory(folder: Path, **settings: str) -> Iterator[Laboratory]:
    """A migrated database, two short studies, and a server that answers; `settings` are its variables."""
    bundles = folder / "bundles"
    for name, (task, channel) in AGENTS.items():
        agent(bundles, task, name, channel)
    port = free_port()
    environment = os.environ | {
        "HATLAB_DATABASE_URL": f"sqlite:///{folder / 'hatlab.sqlite3'}",
        "HATLAB_BUNDLES": str(bundles),
        "HATLAB_ADMIN_PASSWORD": "only for tests, never elsewhere",
        "HATLAB_PUBLIC_URL": f"http://127.0.0.1:{port}",
        "OMP_NUM_THREADS": "1",
        **settings,
    }
    here = Laboratory(folder, environment["HATLAB_PUBLIC_URL"], environment)
    made = here.hatlab("init")
    assert made.returncode == 0, made.stderr
    shorten(here)
    with (folder / "server.log").open("w") as log:
        command = (*HATLAB, "serve", "--port", str(port))
        server = subprocess.Popen(command, env=environment, cwd=ROOT, stdout=log, stderr=log)
        try:
            wait_for(here, server)
            yield here
        finally:
            stop(server)


def agent(root: Path, task: str, name: str, channel: str) -> None:
    """An untrained agent whose signs stand on an ellipse, so that each of them can be clicked."""
    made = tiny_policy(task, channel=channel)
    angles = 2 * np.pi * np.arange(TOKENS) / TOKENS
    places = 0.5 + 0.35 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    counts = np.random.default_rng(1).integers(0, 50, (TOKENS, registry.make(task).cells))
    lexicon = Lexicon.from_counts(counts, places, (0.6, 0.3), seed=1)
    bundle.save(root, tiny_manifest(made, task, name), made.weights(), lexicon, {"episodes": 0}, "# tiny\n")


def shorten(here: Laboratory) -> None:
    """Launch the short and the whole studies, with one arm per agent that is here."""
    settings = Settings(database_url=here.environment["HATLAB_DATABASE_URL"], bundles=here.folder / "bundles")
    lab = Lab.open(settings)
    with lab.database.writing() as db:
        short = {changes["slug"]: (template, changes) for template, changes in SHORT.items()}
        for slug, (template, changes) in (short | WHOLE).items():
            values = tomllib.loads((ROOT / "server" / "studies" / f"{template}.toml").read_text())
            arms = [arm for arm in values["arms"] if arm["bundle"] in AGENTS]
            named = {"slug": slug, "arms": arms, "completion_url": PROLIFIC}
            definition = study.read(values | ROUNDS_ONLY | changes | named)
            made = studies.create(
                db, lab, definition.model_dump(mode="json"), definition.title, definition.slug
            )
            studies.freeze(db, lab, studies.find(db, made).row.id, definition)
    lab.database.close()


def wait_for(here: Laboratory, server: "subprocess.Popen[bytes]") -> None:
    deadline = time.monotonic() + READY_S
    while time.monotonic() < deadline:
        assert server.poll() is None, (here.folder / "server.log").read_text()
        try:
            health = httpx.get(f"{here.url}/healthz", timeout=2).json()
        except httpx.HTTPError:
            time.sleep(0.2)
            continue
        assert health["ok"], health
        return
    raise AssertionError("the server did not answer in time")


def stop(server: "subprocess.Popen[bytes]") -> None:
    """Ask it to end; on a busy machine one that is still loading its agents does not hear that in time."""
    server.terminate()
    try:
        server.wait(timeout=20)
    except subprocess.TimeoutExpired:
        server.kill()
        server.wait()


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])
