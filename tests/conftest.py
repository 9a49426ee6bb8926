"""What holds for every test: a process computes in one thread, and workers share the tests out by file."""

import os
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from xdist.scheduler import LoadScopeScheduling

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    # Read when numpy and torch are loaded, later than this, and by every process that a test starts. Networks
    # of tests are so small that in rollouts a second thread only spins. (Training sets one thread by itself.)
    os.environ.setdefault(_variable, "1")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> "LoadScopeScheduling":
    """Give a worker of `pytest -n` a whole file, in the order of the files.

    What a module makes once is then made once. All of tests/e2e counts as one file: one browser at a time.
    It stands early in the order, and must, because it takes longest.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return "tests/e2e" if nodeid.startswith("tests/e2e/") else nodeid.partition("::")[0]

    config.option.loadscopereorder = False
    return ByFile(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes minutes begins first: at the end one worker would wait for the other."""
    items.sort(key=lambda item: not item.nodeid.startswith("tests/torture/"))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """A skipped browser test is said at the end, where nobody can miss it.

    It stands here because the process that reports for workers reads no other conftest.
    """
    skipped = [each for each in terminalreporter.stats.get("skipped", []) if "tests/e2e" in each.nodeid]
    if skipped:
        from tests.e2e.conftest import missing

        told = f"{len(skipped)} BROWSER TESTS SKIPPED: they need {', '.join(missing())}"
        terminalreporter.write_line(f"*** {told} ***", yellow=True, bold=True)
