"""An experimenter in real Chromium: keyboard, both window sizes, both themes, axe-core, live counts."""

import subprocess

import pytest

from tests.e2e.laboratory import ROOT, Laboratory

pytestmark = pytest.mark.browser

ARTEFACTS = ROOT / "artefacts" / "e2e"


def test_an_experimenter_builds_launches_and_watches_a_study(lab: Laboratory) -> None:
    password = lab.environment["HATLAB_ADMIN_PASSWORD"]
    done = subprocess.run(
        ("node", "tests/e2e/admin.mjs", lab.url, str(ARTEFACTS), password),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stderr + (lab.folder / "server.log").read_text()[-2000:]
