"""A table as Markdown, from the stored cells alone: the paper's figure beside ours, and what it cost."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from models.reproduce.lines import RATE_TOLERANCE, Line, Number, Stock, convergence, number
from models.reproduce.tables import EPOCH_STEPS, SLACK, Column, Entry
from models.training.convergence import IN_A_ROW, Unreached

NOTHING = "–"
MILLION = 1e6
HEAD = """\
This page is printed by `hatlab reproduce {name}` from the JSON files in `cells`, where every number
was measured on {episodes:,} greedy episodes (argmax) that training never saw. *n* is the number of seeds.
Ours is the mean over seeds, in round brackets the range; with one seed, in square brackets the 95 % interval
over episodes (Wilson for shares of episodes, else bootstrap). *Converged*: environment steps until
{in_a_row} evaluations in a row hold the criterion, the paper's figure less {slack:g}; under a budget the
message rate must be within {tolerance:g} of it too. *{too_short}*: it held to the end of training, but in
fewer evaluations than that. The paper's epochs are {epoch:,} steps each. Steps and
CPU-minutes (of one core, measured by the process) in brackets include those of the agents that an agent
starts from."""


def page(stock: Stock) -> str:
    """Print the whole table."""
    table = stock.table
    head = HEAD.format(
        name=table.name, episodes=table.episodes, in_a_row=IN_A_ROW, epoch=EPOCH_STEPS,
        slack=SLACK, tolerance=RATE_TOLERANCE, too_short=Unreached.TOO_SHORT.capitalize(),
    )  # fmt: skip
    sections = [_section(column, stock.lines(column)) for column in table.column]
    return "\n\n".join([f"# {table.title}", head, table.text.strip(), *sections]) + "\n"


def _section(column: Column, lines: Sequence[Line]) -> str:
    heads = ["method", "n"]
    for shown in column.measures:
        papered = any(shown.path in line.entry.paper for line in lines)
        heads += [f"{shown.title}, paper", f"{shown.title}, ours"] if papered else [shown.title]
    if column.converged is not None:
        heads += ["converged, paper", "converged, ours"]
    heads += ["env steps", "CPU-min", "CPU-min, public code", "help besides reward"]
    rows = [_row(line, lines) for line in lines]
    rule = "|---|" + "---:|" * (len(heads) - 2) + "---|"
    table = [f"| {' | '.join(cells)} |" for cells in rows]
    return "\n".join([f"## {column.title}", "", f"| {' | '.join(heads)} |", rule, *table])


def _row(line: Line, lines: Sequence[Line]) -> list[str]:
    column, entry = line.column, line.entry
    cells = [line.method, f"{len(line.seeds)} of {line.wanted}" if line.records else line.status]
    for shown in column.measures:
        if any(shown.path in other.entry.paper for other in lines):
            cells.append(_rounded(entry.paper.get(shown.path), shown.digits))
        cells.append(_ours(number(line.records, shown.path), shown.digits))
    if column.converged is not None:
        cells += [_paper_steps(entry), _our_steps(line)]
    public = entry.public_cpu_minutes
    return [
        *cells,
        _cost(line.records, "env_steps", lambda steps: f"{steps / MILLION:.2f} M"),
        _cost(line.records, "cpu_minutes", lambda minutes: f"{minutes:.1f}"),
        NOTHING if public is None else f"≈ {public:,.0f}",
        _help(line.records),
    ]


def _rounded(value: float | None, digits: int) -> str:
    return NOTHING if value is None else f"{value:.{digits}f}"


def _ours(figure: Number | None, digits: int) -> str:
    if figure is None:
        return NOTHING
    middle = _rounded(figure.mean, digits)
    if figure.low is None or figure.high is None:
        return middle
    low, high = _rounded(figure.low, digits), _rounded(figure.high, digits)
    return f"{middle} ({low} to {high})" if figure.kind.startswith("range") else f"{middle} [{low}, {high}]"


def _cost(records: Sequence[dict[str, Any]], key: str, text: Callable[[float], str]) -> str:
    """Mean over seeds, and in brackets with those of the ancestors; "?" where nobody measured it."""
    if not records:
        return NOTHING
    own = [stored["training"][key] for stored in records]
    before = [stored["training"][f"{key}_before"] for stored in records]
    if any(value is None for value in own):
        return "?"
    mean = sum(own) / len(own)
    if any(value is None for value in before):
        return f"{text(mean)} (?)"
    return f"{text(mean)} ({text(mean + sum(before) / len(before))})" if any(before) else text(mean)


def _paper_steps(entry: Entry) -> str:
    if entry.epochs is None:
        return NOTHING
    sign = "+" if entry.additional else ""
    return f"{sign}{entry.epochs * EPOCH_STEPS / MILLION:.1f} M ({sign}{entry.epochs:g} epochs)"


def _our_steps(line: Line) -> str:
    steps = convergence(line)
    if not line.records or not steps:
        return NOTHING
    reached = [value for value in steps if not isinstance(value, Unreached)]
    short = sum(value is Unreached.TOO_SHORT for value in steps)
    if short == len(steps):
        return str(Unreached.TOO_SHORT)
    unsure = f", {short} of {len(steps)} {Unreached.TOO_SHORT}" if short else ""
    if not reached:
        return f"{Unreached.NEVER}{unsure}"
    mean = sum(reached) / len(reached)
    sign = "+" if line.entry.additional else ""
    share = "" if len(reached) == len(steps) else f", {len(reached)} of {len(steps)}"
    return f"{sign}{mean / MILLION:.2f} M{share}{unsure}"


def _help(records: Iterable[dict[str, Any]]) -> str:
    """Warm start and supervised help of the recipe; seeds do not differ in it."""
    for stored in records:
        start, used = stored["warm_start"], stored["supervised_help"]
        parts = [f"warm start: {start}" if start else "", used if used != "none" else ""]
        return "; ".join(filter(None, parts)) or "none"
    return NOTHING
