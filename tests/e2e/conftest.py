"""What browser tests need: Node 20, Chromium, playwright-core.

Without them they skip loudly, or fail where nothing may skip.
"""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.laboratory import ROOT, Laboratory, laboratory

NODE_MAJOR = 20
CHROMIUM = ("chromium", "chromium-browser", "google-chrome")  # the same names as in browser.mjs


def missing() -> list[str]:
    """What is not here, by the name under which to install it."""
    named = os.environ.get("HATLAB_CHROMIUM")
    chromium = Path(named).exists() if named else any(map(shutil.which, CHROMIUM))
    wanted = {
        f"Node {NODE_MAJOR}": node_is_new_enough(),
        "Chromium": chromium,
        "node_modules (npm ci)": (ROOT / "node_modules" / "playwright-core").is_dir(),
    }
    return [name for name, here in wanted.items() if not here]


def node_is_new_enough() -> bool:
    node = shutil.which("node")
    if node is None:
        return False
    version = subprocess.run((node, "--version"), capture_output=True, text=True, check=False).stdout
    return version.startswith("v") and int(version[1:].split(".")[0]) >= NODE_MAJOR


@pytest.fixture(scope="session")
def browser() -> None:
    """Skips, or fails where HATLAB_REQUIRE_BROWSER=1 says that nothing may skip."""
    absent = missing()
    if not absent:
        return
    told = f"browser tests need {', '.join(absent)}"
    if os.environ.get("HATLAB_REQUIRE_BROWSER") == "1":
        pytest.fail(told)
    pytest.skip(told)


@pytest.fixture(scope="module")
def lab(browser: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Laboratory]:
    with laboratory(tmp_path_factory.mktemp("laboratory")) as here:
        yield here
