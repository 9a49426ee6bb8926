"""A worker keeps its threads on one core, and workers of one server on different ones."""

import os
import subprocess
import sys

import pytest

CODE = """
import multiprocessing, os
from server.app import stay_on_one_core
multiprocessing.current_process().name = "SpawnProcess-{number}"
stay_on_one_core()
print(sorted(os.sched_getaffinity(0)))
"""

pytestmark = pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="cores are Linux's to give")


def core_of(number: int) -> str:
    code = CODE.format(number=number)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    return done.stdout.strip()


def test_every_worker_stays_on_one_core_and_the_next_one_on_the_next() -> None:
    cores = len(os.sched_getaffinity(0))
    taken = [core_of(number) for number in (1, 2)]
    assert all(text.count(",") == 0 for text in taken)
    assert len(set(taken)) == min(2, cores)
