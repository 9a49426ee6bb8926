"""`python -m benchmarks [--full] [--record] [name …]`: every benchmark in turn, each in a process of its own.

Short by default. `--record` puts what is printed into docs/measurements.md as well. A benchmark is a module
of this folder that can be run by itself; `reaction_time` needs Chromium.
"""

import subprocess
import sys
from importlib.util import find_spec

from benchmarks import measurements, table

NAMES = ("training", "steps", "export", "pages", "reaction_time")
FULL, RECORD = "--full", "--record"
TAKES_LONGER = ("steps",)
"""Benchmarks that know `--full`."""
BAD_INPUT = 2


def main(arguments: list[str]) -> int:
    """Run the named benchmarks, or all; give the exit code."""
    options = [argument for argument in arguments if argument.startswith("-")]
    names = [argument for argument in arguments if not argument.startswith("-")] or list(NAMES)
    if wrong := [*(set(names) - set(NAMES)), *(set(options) - {FULL, RECORD})]:
        print(f"unknown {wrong[0]}: choose from {', '.join(NAMES)}, {FULL}, {RECORD}", file=sys.stderr)
        return BAD_INPUT
    failed = [name for name in names if not run(name, full=FULL in options, keep=RECORD in options)]
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return int(bool(failed))


def run(name: str, *, full: bool, keep: bool) -> bool:
    """Run one benchmark and pass on what it prints; give whether it came to its end."""
    table.console.rule(f"benchmarks.{name}", align="left")
    if find_spec(f"benchmarks.{name}") is None:
        print(f"there is no benchmarks.{name}", file=sys.stderr)
        return False
    first = table.machine()
    print(first, flush=True)
    command = [sys.executable, "-m", f"benchmarks.{name}", *([FULL] if full and name in TAKES_LONGER else [])]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    lines = [first + "\n"]
    for line in process.stdout:
        print(line, end="", flush=True)
        lines.append(line)
    done = process.wait() == 0
    if keep and done:
        measurements.record(f"python -m benchmarks {name}", "".join(lines))
    return done


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
