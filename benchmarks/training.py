"""Environment steps per second of training, on one core: episodes, loss, gradients and the optimiser's step.

Prints the median of several repeats of whole updates, with the slowest and the fastest, and the ratio to the
public IC3Net code where its speed on the same kind of machine is known (environment steps per CPU-second of
one core).

Run: python benchmarks/training.py [--repeats 5] [--updates 3]
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import torch

from models.training.allocation import keep_freed_memory
from models.training.config import Recipe, parse
from models.training.run import PACKAGED
from models.training.trainer import Trainer

EPISODES = 400


class Case(NamedTuple):
    """One row: what is trained, and how fast the public code trains it."""

    label: str
    recipe: dict[str, Any]
    public: float | None


def recipe(task: str, hidden: int, message: int, tokens: int, decoder: str) -> dict[str, Any]:
    """One policy-gradient phase of the given sizes on the world's own situations."""
    channel = "prototype" if tokens else "continuous"
    phase = {"name": "bench", "updates": 10**6, "episodes": EPISODES, "entropy": 0.1}
    phase |= {"decoder_weight": 0.1 if decoder != "none" else 0.0}
    return {
        "name": "bench/bench",
        "task": task,
        "seed": 1,
        "model": {"hidden": hidden, "message": message, "tokens": tokens, "channel": channel},
        "decoder": {"target": decoder, "reads": "inbox"},
        "check": {"every": 10**6},
        "phase": [phase],
    }


CASES = (
    Case("medium, hidden 64", recipe("traffic_junction/medium", 64, 64, 0, "none"), 546),
    Case("medium, as shipped", recipe("traffic_junction/medium", 96, 64, 112, "occupancy"), 546),
    Case("easy, hidden 64", recipe("traffic_junction/easy", 64, 64, 0, "none"), 629),
    Case("parent_child, as shipped", recipe("parent_child", 64, 9, 9, "location"), None),
)


def speeds(described: Recipe, repeats: int, updates: int) -> list[float]:
    """Environment steps per second of each repeat."""
    with tempfile.TemporaryDirectory() as folder:
        trainer = Trainer(described, Path(folder), PACKAGED)
        trainer.open(resume=False)
        trainer.advance()  # the first update also fills caches
        found = []
        for _ in range(repeats):
            before, begun = trainer.at.steps, time.process_time()
            for _ in range(updates):
                trainer.advance()
            found.append((trainer.at.steps - before) / (time.process_time() - begun))
        return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--updates", type=int, default=3)
    given = parser.parse_args()
    torch.set_num_threads(1)
    keep_freed_memory()
    size = f"{given.repeats} repeats of {given.updates} updates, {EPISODES} episodes each"
    print(f"Training throughput, one core: {size}")
    print(f"{'':26}{'env steps/s':>12}{'slowest':>10}{'fastest':>10}{'public code':>13}{'ratio':>8}")
    for case in CASES:
        found = speeds(parse(case.recipe), given.repeats, given.updates)
        middle = statistics.median(found)
        public = f"{case.public:>13,.0f}{middle / case.public:>7.1f}x" if case.public else f"{'':>13}{'':>8}"
        print(f"{case.label:26}{middle:>12,.0f}{min(found):>10,.0f}{max(found):>10,.0f}{public}")


if __name__ == "__main__":
    main()
