"""`python -m benchmarks [--full] [name …]`: every benchmark in turn, each in a process of its own.

Short by default. A benchmark is a module of this folder that can be run by itself; `reaction_time` needs
Chromium.
"""

import subprocess
import sys
from importlib.util import find_spec

from benchmarks import table

NAMES = ("training", "steps", "export", "pages", "reaction_time")
BAD_INPUT = 2


def main(arguments: list[str]) -> int:
    """Run the named benchmarks, or all; give the exit code."""
    options = [argument for argument in arguments if argument.startswith("-")]
    names = [argument for argument in arguments if not argument.startswith("-")] or list(NAMES)
    if wrong := [name for name in names if name not in NAMES] or [o for o in options if o != "--full"]:
        print(f"unknown {wrong[0]}: choose from {', '.join(NAMES)}, and --full", file=sys.stderr)
        return BAD_INPUT
    table.console.print(table.machine())
    failed = [name for name in names if not run(name, options)]
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return int(bool(failed))


def run(name: str, options: list[str]) -> bool:
    """Run one benchmark; give whether it came to its end."""
    table.console.rule(f"benchmarks.{name}", align="left")
    module = f"benchmarks.{name}"
    if find_spec(module) is None:
        print(f"there is no {module}", file=sys.stderr)
        return False
    taken = options if name == "steps" else []
    return subprocess.run([sys.executable, "-m", module, *taken], check=False).returncode == 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
