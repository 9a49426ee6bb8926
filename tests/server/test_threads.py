"""A server process computes in the threads of its requests, and in no others."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

COUNT = """
import os
import server.app
import numpy as np
square = np.ones((400, 400), np.float32)
square @ square
print(len(os.listdir("/proc/self/task")))
"""


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="threads are counted in /proc")
def test_a_matrix_product_is_not_shared_among_cores() -> None:
    plain = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", COUNT], env=plain, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "1"
