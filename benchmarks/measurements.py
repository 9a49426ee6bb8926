"""docs/measurements.md: what commands printed, each output under the command that printed it.

A section is replaced only by the command that it names, so that no figure there was typed.
"""

from datetime import UTC, datetime
from pathlib import Path

PATH = Path(__file__).parents[1] / "docs" / "measurements.md"
HEAD = """# Measurements

Every block below is the output of the command above it, written here by that command's `--record`. Wall-clock
figures depend on what else ran on the machine at that time; its load stands in the first line of each block.
"""


def record(command: str, output: str, path: Path = PATH) -> None:
    """Put the output of a command into its section, which is added at the end if it is new."""
    sections = read(path)
    day = datetime.now(UTC).date().isoformat()
    sections[command] = f"\n## `{command}`\n\nPrinted on {day}.\n\n```text\n{output.strip()}\n```\n"
    path.write_text(HEAD + "".join(sections.values()), encoding="utf-8")


def read(path: Path) -> dict[str, str]:
    """Give the sections by their command, in order."""
    if not path.exists():
        return {}
    _, *parts = path.read_text(encoding="utf-8").split("\n## `")
    return {part.partition("`\n")[0]: f"\n## `{part}" for part in parts}
