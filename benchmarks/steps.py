"""One step request: server CPU, throughput and latency at 1, 50 and 200 robots, on SQLite and on PostgreSQL.

SQLite runs with `synchronous=FULL` and one worker, PostgreSQL with fsync and two workers. An action is
durable before it is answered. Robots share the cores with the server, so their CPU is printed beside it.
Compared with oTree 6.0.15 on such a machine: form pages 47-56 submissions/s, live pages 150-166 actions/s.
"""

import asyncio
import sys
from collections.abc import Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

from benchmarks import load, table
from benchmarks.load import Player, Seat
from benchmarks.served import Cpu, DatabaseName, Served, served
from server.simulate.crowd import quantile

OTREE_FORMS, OTREE_LIVE = 56.0, 166.0
"""Best figures of oTree 6.0.15: submissions/s of form pages, actions/s of live pages."""
STUDY = "traffic-junction"
WINDOWS = 3
PREPARING, PREPARING_S = 12, 8.0
SPARE = 60
"""People who follow those who have played all their rounds."""
AIM_CPU_MS, AIM_P99_MS = 1.5, 50.0
AIM_RATE = {"sqlite": 200.0, "postgresql": 600.0}
NAMES = {"sqlite": "SQLite FULL, 1 worker", "postgresql": "PostgreSQL, 2 workers"}


class Level(NamedTuple):
    """How many robots play, and how fast each (None: as fast as answers come)."""

    robots: int
    rate: float | None


LEVELS = (Level(1, None), Level(50, None), Level(200, None), Level(50, 1.0))


@dataclass(frozen=True, slots=True)
class Figure:
    """One line of the table; CPU is milliseconds a step, everything the server did in the window included."""

    level: Level
    rate: float
    server_ms: float
    database_ms: float
    robots_ms: float
    p50_ms: float
    p99_ms: float


def main(*, full: bool) -> None:
    """Measure and print; `full` takes longer windows."""
    for database in ("sqlite", "postgresql"):
        figures = measure(database, seconds=10.0 if full else 3.0)
        table.show(
            f"One step of Traffic Junction, {NAMES[database]}",
            (
                "robots",
                "steps/s",
                "x oTree forms",
                "x oTree live",
                "server CPU ms",
                "database CPU ms",
                "robots CPU ms",
                "p50 ms",
                "p99 ms",
            ),
            [line(figure) for figure in figures],
            "\n".join(verdicts(database, figures)),
        )


def measure(database: DatabaseName, seconds: float, levels: Sequence[Level] = LEVELS) -> list[Figure]:
    """Measure all levels on one server."""
    with served(database) as house:
        slug = house.add_study(STUDY, places=2_000)
        people = sum(level.robots for level in levels) + SPARE
        return asyncio.run(_measure(house, slug, people, levels, seconds))


async def _measure(
    house: Served, slug: str, people: int, levels: Sequence[Level], seconds: float
) -> list[Figure]:
    seats = await load.enter(house.url, "127.0.0.1", house.port, slug, people, house.sign)
    await _prepare(seats)
    return [await _level(house, seats, level, seconds) for level in levels]


async def _prepare(queue: list[Seat]) -> None:
    """Play until the workers have met the situations: how a round begins is computed once and kept."""
    async with AsyncExitStack() as stack:
        players = [await stack.enter_async_context(load.player(queue)) for _ in range(PREPARING)]
        await load.warm_up(players)
        await load.play(players, PREPARING_S, None)


async def _level(house: Served, queue: list[Seat], level: Level, seconds: float) -> Figure:
    async with AsyncExitStack() as stack:
        players = [await stack.enter_async_context(load.player(queue)) for _ in range(level.robots)]
        await load.warm_up(players)
        windows = [await _window(house, players, level, seconds) for _ in range(WINDOWS)]
    latencies = sorted(ms for window, _ in windows for ms in window.latencies_ms)

    def each(part: int) -> float:
        return median(cpu[part] * 1000 / len(window.latencies_ms) for window, cpu in windows)

    return Figure(
        level=level,
        rate=median(window.rate for window, _ in windows),
        server_ms=each(0),
        database_ms=each(1),
        robots_ms=each(2),
        p50_ms=median(latencies),
        p99_ms=quantile(latencies, 0.99),
    )


async def _window(
    house: Served, players: Sequence[Player], level: Level, seconds: float
) -> tuple[load.Load, Cpu]:
    before = house.cpu()
    window = await load.play(players, seconds, level.rate)
    return window, house.cpu().since(before)


def line(figure: Figure) -> tuple[str, ...]:
    level = figure.level
    pace = f"{level.robots} x {level.rate:g}/s" if level.rate else f"{level.robots}, no pause"
    forms, live = figure.rate / OTREE_FORMS, figure.rate / OTREE_LIVE
    ratios = ("-", "-") if level.rate else (f"{forms:.1f}", f"{live:.1f}")
    times = (figure.server_ms, figure.database_ms, figure.robots_ms)
    return (
        pace,
        f"{figure.rate:.0f}",
        *ratios,
        *(f"{ms:.2f}" for ms in times),
        f"{figure.p50_ms:.1f}",
        f"{figure.p99_ms:.1f}",
    )


def verdicts(database: DatabaseName, figures: Sequence[Figure]) -> list[str]:
    """Set the figures against the aims."""
    best = max(figure.rate for figure in figures if not figure.level.rate)
    cpu = min(figure.server_ms for figure in figures if not figure.level.rate)
    paced = [figure for figure in figures if figure.level.rate]
    lines = [
        verdict(f"durable actions/s {best:.0f}", best >= AIM_RATE[database], f"≥ {AIM_RATE[database]:.0f}"),
        verdict(f"server CPU {cpu:.2f} ms a step", cpu <= AIM_CPU_MS, f"≤ {AIM_CPU_MS} ms"),
    ]
    return lines + [
        verdict(
            f"p99 {each.p99_ms:.1f} ms at {each.level.robots} robots of {each.level.rate:g}/s",
            each.p99_ms <= AIM_P99_MS,
            f"≤ {AIM_P99_MS:.0f} ms",
        )
        for each in paced
    ]


def verdict(what: str, met: bool, aim: str) -> str:
    return f"{'met   ' if met else 'missed'}  {what} (aim {aim})"


if __name__ == "__main__":
    main(full="--full" in sys.argv)
