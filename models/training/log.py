"""``log.csv`` of a run: a line per check, the raw material of learning curves and of convergence."""

import csv
from collections.abc import Iterable
from pathlib import Path

FILE = "log.csv"
COLUMNS = (
    "phase", "update", "total", "env_steps", "seconds", "cpu_s", "lr", "loss", "parts", "entropy", "decoder",
    "drawn_rate", "success", "human", "arrived", "steps", "reward", "message_rate", "human_rate",
    "tokens_used", "score", "best",
)  # fmt: skip
"""``total`` counts updates over all phases; ``entropy`` and ``decoder`` are in nats, of the last update, the
latter empty without a decoder; ``drawn_rate`` is the share of messages that the last update sent, with
gates drawn as training draws them; ``success`` to ``score`` are fields of
``models.training.checks.Checked``, with greedy gates."""

Row = dict[str, str]


def start(folder: Path) -> None:
    """Write the head of a new log."""
    with (folder / FILE).open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerow(COLUMNS)


def add(folder: Path, row: Iterable[object]) -> None:
    """Append the values of all columns; floats get four digits, and None is left empty."""
    with (folder / FILE).open("a", newline="", encoding="utf-8") as file:
        csv.writer(file).writerow([f"{value:.4f}" if isinstance(value, float) else value for value in row])


def size(folder: Path) -> int:
    """Bytes so far."""
    return (folder / FILE).stat().st_size


def cut(folder: Path, length: int) -> None:
    """Forget what was logged after the checkpoint; a log with fewer columns (an older version) gets all."""
    with (folder / FILE).open("r+b") as file:
        file.truncate(length)
    rows = read(folder)
    if rows and tuple(rows[0]) != COLUMNS:
        start(folder)
        for row in rows:
            add(folder, [row.get(column, "") for column in COLUMNS])


def read(folder: Path) -> list[Row]:
    """All lines, by column."""
    with (folder / FILE).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
