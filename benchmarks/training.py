"""Environment steps per second of training: episodes, loss, gradients and the optimiser's step.

Three tables: speed of one core (processor time of whole updates, median of several repeats) beside the floor
and, where it is known, the public IC3Net code on the same kind of machine; where the time goes; and what two
processes on two cores do at once (wall time, so that it says little while other programs run). The floor is
the bare network: forward and backward through every layer, on the observations of a real update and random
memories, and nothing else; equal observations are encoded once, as training does. In Traffic Junction the
first policy is set to gas at nineteen steps in twenty: brakes at random fill the roads with half as many cars
again as training meets.

Run: python -m benchmarks.training [--repeats 5] [--updates 3] [--only medium]
"""

import argparse
import cProfile
import multiprocessing
import os
import pstats
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from benchmarks import table
from models.envs.traffic_junction import TrafficJunction
from models.policies.recurrent import Memory
from models.training.allocation import keep_freed_memory
from models.training.arithmetic import Arithmetic, Seen, distinct
from models.training.config import Recipe, parse
from models.training.reinforce import Learner
from models.training.run import PACKAGED
from models.training.trainer import Trainer

EPISODES = 400
PROCESSES = 2
DRIVES = (3.0, 0.0)
"""Logits of gas and brake: brake in 1 / (1 + e^3) = .05 of the steps."""
WORLD = ("init", "step", "observe", "alive", "fresh", "done")
"""Methods of an environment that training calls."""


class Case(NamedTuple):
    """One row: what is trained, and how fast the public code trains it (steps per CPU-second)."""

    label: str
    recipe: dict[str, Any]
    public: float | None = None


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
    Case("hard, hidden 64", recipe("traffic_junction/hard", 64, 64, 0, "none")),
    Case("predator_prey 5x5, hidden 64", recipe("predator_prey/5x5", 64, 64, 0, "none"), 775),
    Case("predator_prey 10x10, hidden 64", recipe("predator_prey/10x10", 64, 64, 0, "none"), 607),
    Case("parent_child, as shipped", recipe("parent_child", 64, 9, 9, "location")),
)


def opened(described: Recipe, folder: str) -> Trainer:
    """A run that has done its first update, which also fills caches."""
    torch.set_num_threads(1)
    keep_freed_memory()
    trainer = Trainer(described, Path(folder), PACKAGED)
    trainer.open(resume=False)
    if isinstance(trainer.env, TrafficJunction):
        with torch.no_grad():
            trainer.learner.net.head[-1].bias.copy_(torch.tensor(DRIVES))
    trainer.advance()
    return trainer


def speeds(trainer: Trainer, repeats: int, updates: int, clock: Callable[[], float]) -> list[float]:
    """Environment steps per second of each repeat."""
    found = []
    for _ in range(repeats):
        before, begun = trainer.at.steps, clock()
        for _ in range(updates):
            trainer.advance()
        found.append((trainer.at.steps - before) / (clock() - begun))
    return found


def floor(trainer: Trainer, sights: list[Seen], steps: int, repeats: int) -> list[float]:
    """Environment steps per second if the bare network were all."""
    found = []
    for _ in range(repeats):
        begun = time.process_time()
        bare(trainer.learner, sights).backward()
        found.append(steps / (time.process_time() - begun))
    return found


def sights_of(trainer: Trainer) -> tuple[list[Seen], int]:
    """What living agents saw at each step of one update, and its environment steps."""
    ((seen, _),) = trainer._windows(trainer.phase, trainer.at.total)  # noqa: SLF001 (shares its situations)
    env, sights = trainer.env, []
    for step, state in enumerate(seen.states[:-1]):
        observation = env.observe(state).reshape(-1, env.observation_size)[seen.place[seen.step == step]]
        first, which = distinct(observation)
        sights.append(Seen(torch.from_numpy(observation[first]), torch.from_numpy(which)))
    running = ~np.stack([env.done(state) for state in seen.states[:-1]])
    return sights, int(running.sum())


def bare(learner: Learner, sights: list[Seen]) -> Tensor:
    """A number that depends on every layer, from what agents saw and random memories."""
    size, work = learner.net.architecture, Arithmetic(learner.net)
    sums, features = [], []
    for seen in sights:
        count = len(seen.which)
        memory = Memory(*(torch.randn(count, size.hidden, requires_grad=True) for _ in Memory._fields))
        spoken = work.speak(memory, seen)
        done = work.act(spoken, spoken.said.message)
        features.append(done.features)
        sums += [done.logits.sum(), done.memory.cell1.sum(), done.memory.cell2.sum()]
    together = torch.cat(features)
    sums.append(learner.critic(together).sum())
    if learner.decoder is not None:
        hidden, heard = together[:, : size.hidden], together[:, size.hidden : size.hidden + size.message]
        sums.append(learner.decoder(hidden, heard).sum())
    return torch.stack(sums).sum()


def shares(trainer: Trainer, updates: int) -> dict[str, float]:
    """Where the processor time of an update goes, as shares."""
    profile = cProfile.Profile(time.process_time)
    begun = time.process_time()
    profile.enable()
    for _ in range(updates):
        trainer.advance()
    profile.disable()
    whole = time.process_time() - begun
    spent = _spent(pstats.Stats(profile))
    world = sum(spent(type(trainer.env).__module__.replace(".", "/"), name) for name in WORLD)
    parts = {
        "world": world,
        "forward": spent("training/unroll", "unroll") - world,
        "loss": spent("training/reinforce", "gradient_loss"),
        "backward": spent("", "run_backward"),
        "optimiser": spent("optim/adam", "step") + spent("utils/clip_grad", "clip_grad_norm_"),
    }
    parts["rest"] = whole - sum(parts.values())
    return {name: seconds / whole for name, seconds in parts.items()}


def _spent(stats: pstats.Stats) -> Callable[[str, str], float]:
    """Seconds spent in a function of a file, with everything that it calls."""

    def spent(file: str, function: str) -> float:
        rows = stats.stats.items()  # type: ignore[attr-defined]
        return max((row[3] for (path, _, name), row in rows if file in path and function in name), default=0)

    return spent


def side_by_side(described: Recipe, repeats: int, updates: int, processes: int) -> float:
    """Environment steps per second of wall time, of so many processes together, each on a core of its own."""
    context = multiprocessing.get_context("spawn")
    ready, results = context.Barrier(processes), context.Queue()
    children = [
        context.Process(target=_alone, args=(described, repeats, updates, core, ready, results))
        for core in sorted(os.sched_getaffinity(0))[:processes]
    ]
    for child in children:
        child.start()
    found = [results.get() for _ in children]
    for child in children:
        child.join()
    return sum(found)


def _alone(described: Recipe, repeats: int, updates: int, core: int, ready: Any, results: Any) -> None:
    os.sched_setaffinity(0, {core})
    with tempfile.TemporaryDirectory() as folder:
        trainer = opened(described, folder)
        ready.wait()
        results.put(statistics.median(speeds(trainer, repeats, updates, time.perf_counter)))


class Measured(NamedTuple):
    """One case on one core."""

    speeds: list[float]
    rows: float
    """That go through the network, per environment step."""
    different: float
    """... and are encoded, because no other agent sees the same at that step."""
    floor: float
    shares: dict[str, float]


def measure(case: Case, repeats: int, updates: int) -> Measured:
    with tempfile.TemporaryDirectory() as folder:
        trainer = opened(parse(case.recipe), folder)
        found = speeds(trainer, repeats, updates, time.process_time)
        sights, steps = sights_of(trainer)
        rows, different = (sum(len(seen[part]) for seen in sights) / steps for part in (1, 0))
        bottom = statistics.median(floor(trainer, sights, steps, repeats))
        return Measured(found, rows, different, bottom, shares(trainer, updates))


def show(cases: list[Case], measured: list[Measured], size: str) -> None:
    """Print speed and shares."""
    rows, parts = [], []
    for case, found in zip(cases, measured, strict=True):
        middle = statistics.median(found.speeds)
        public = (f"{case.public:,.0f}", f"{middle / case.public:.1f}x") if case.public else ("", "")
        numbers = (middle, min(found.speeds), max(found.speeds), found.floor)
        shown = (*(f"{number:,.0f}" for number in numbers), f"{middle / found.floor:.2f}")
        agents = (f"{found.rows:.1f}", f"{found.different:.1f}")
        rows.append((case.label, *agents, *shown, *public))
        parts.append((case.label, *(f"{share:.0%}" for share in found.shares.values())))
    columns = (
        "",
        "agents a step",
        "encoded",
        "steps/s",
        "slowest",
        "fastest",
        "floor",
        "of floor",
        "public code",
        "ratio",
    )
    table.show(f"Training, one core: {size}", columns, rows)
    table.show("Where the time goes", ("", *measured[0].shares), parts)


def show_scaling(cases: list[Case], repeats: int, updates: int) -> None:
    rows = []
    for case in cases:
        described = parse(case.recipe)
        one, two = (side_by_side(described, repeats, updates, n) for n in (1, PROCESSES))
        rows.append((case.label, f"{one:,.0f}", f"{two:,.0f}", f"{two / one:.2f}x"))
    columns = ("", "one process", f"{PROCESSES} processes", "scaling")
    table.show("Training side by side, steps per second of wall time", columns, rows)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--updates", type=int, default=3)
    parser.add_argument("--only", default="", help="cases whose label contains this")
    given = parser.parse_args()
    cases = [case for case in CASES if given.only in case.label]
    if not cases:
        parser.error(f"--only {given.only}: no such case; there are {'; '.join(c.label for c in CASES)}")
    size = f"{given.repeats} repeats of {given.updates} updates, {EPISODES} episodes each"
    show(cases, [measure(case, given.repeats, given.updates) for case in cases], size)
    show_scaling(cases, given.repeats, given.updates)


if __name__ == "__main__":
    main()
