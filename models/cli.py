"""The commands of the science: `hatlab train`, `evaluate`, `release`, `import` and others.

Exit code 0: done; 1: something failed on the way (a broken bundle, a loss that is not a number, a full disk);
2: bad input. Either way one line on standard error. Mounted by
`server.cli`, which imports this module only when one of the commands is asked for.
"""

from __future__ import annotations

import json
import shutil
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from models.envs import registry
from models.policies import scripted

if TYPE_CHECKING:
    from rich.table import Table

    from models.envs.api import Environment
    from models.evaluate import Survey
    from models.policies.api import Policy
    from models.policies.bundle import PolicyBundle

PACKAGE = Path(__file__).parent
BUNDLES, RECIPES = PACKAGE / "bundles", PACKAGE / "recipes"
FAILED, BAD_INPUT = 1, 2
TABLE_WIDTH = 140


class Start(StrEnum):
    """Situations in which episodes begin."""

    INIT = "init"
    HUMAN = "human"


app = typer.Typer(
    add_completion=False, no_args_is_help=True, rich_markup_mode=None, pretty_exceptions_enable=False
)

BundleArgument = Annotated[
    str, typer.Argument(metavar="BUNDLE", help="Name, such as parent_child/prototype-9, or a folder.")
]
BundlesOption = Annotated[
    Path, typer.Option("--bundles", help="Folder of bundles.", show_default="the packaged ones")
]
SeedOption = Annotated[
    int, typer.Option(min=0, help="Seed of the episodes; the same seed, the same numbers.")
]


@app.callback()
def models() -> None:
    """Train, measure and read agents."""


@app.command()
def train(
    recipe: Annotated[
        str, typer.Argument(metavar="RECIPE", help="TOML file, or the name of a packaged one.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder of the run.", show_default="runs/<recipe>-<seed>")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the folder's last checkpoint.")
    ] = False,
    seed: Annotated[int | None, typer.Option(min=0, help="Another seed than the recipe's.")] = None,
    checkpoint_every: Annotated[
        int | None, typer.Option(min=1, help="Updates between checkpoints, beside those at every check.")
    ] = None,
    device: Annotated[str, typer.Option(help="Where to compute: cpu, cuda, cuda:1, mps, xpu.")] = "cpu",
    bundles: BundlesOption = BUNDLES,
) -> None:
    """Train what a recipe describes; its folder then holds log, curve, recipe and checkpoint."""
    from models import training
    from models.training import checkpoint, held

    source = _recipe_path(recipe)
    try:
        own_seed = training.config.load(source).seed
        training.device.find(device)
        folder = out or Path("runs") / f"{source.stem}-{own_seed if seed is None else seed}"
        own = _own_recipe(source, folder, seed, keep=resume or checkpoint.exists(folder))
        if not (checkpoint.exists(folder) and (folder / held.PROVENANCE).exists()):
            held.Provenance.here().write(folder)
        result = training.run(
            own, folder, resume=resume, bundles=bundles, checkpoint_every=checkpoint_every, device=device
        )
    except (training.StoppedError, OSError) as error:
        _fail(error)
    except (
        training.RecipeError,
        training.TrainingError,
        training.DeviceError,
        checkpoint.CheckpointError,
    ) as error:
        _refuse(error)
    typer.echo(
        f"{result.updates:,} updates, {result.steps:,} environment steps, best score {result.score:.4f}"
    )
    typer.echo(f"release it with: hatlab release {folder} {result.recipe.name}")


@app.command()
def pack(
    run_dir: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="Folder of a hatlab train.")],
) -> None:
    """Pack a run's checkpoint into resume.safetensors, at most 2 MB, from which train --resume goes on."""
    from models.training import packed
    from models.training.checkpoint import CheckpointError

    try:
        path = packed.pack(run_dir)
    except (packed.PackError, CheckpointError) as error:
        _refuse(error)
    except OSError as error:
        _fail(error)
    typer.echo(f"{path}: {path.stat().st_size / 1e6:.2f} MB; near to the checkpoint, not bit for bit")


@app.command()
def evaluate(
    policy: Annotated[
        str,
        typer.Argument(
            metavar="BUNDLE",
            help=f"Bundle (name or folder), folder of a run, or a rule: {', '.join(scripted.NAMES)}.",
        ),
    ],
    task: Annotated[
        str | None, typer.Option(help=f"For a rule: {', '.join(registry.NAMES)}. A bundle has its own.")
    ] = None,
    episodes: Annotated[int, typer.Option(min=1, help="How many.")] = 1_000,
    seed: SeedOption = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    sampled: Annotated[
        bool, typer.Option("--sampled", help="Draw actions and gates instead of argmax.")
    ] = False,
    masked: Annotated[bool, typer.Option("--masked", help="Nobody hears anything.")] = False,
    arrival: Annotated[
        float | None, typer.Option(min=0, max=1, help="Probability of a car per entrance and step.")
    ] = None,
    start: Annotated[
        Start, typer.Option(help="human: trials as participants get them, among 5 to 9 cars.")
    ] = Start.INIT,
    bundles: BundlesOption = BUNDLES,
) -> None:
    """Measure a bundle, a run or a rule-based policy; every number with its 95 % interval."""
    from models import evaluate as measuring

    env, players = _players(policy, task, bundles, seed if sampled else None)
    question = measuring.Question(episodes, seed, start.value, arrival, masked)
    try:
        found = measuring.survey(env, players, question)
    except (ValueError, scripted.WrongTaskError) as error:
        _refuse(error)
    asked = {
        "policy": policy,
        "task": env.name,
        "episodes": episodes,
        "seed": seed,
        "start": start.value,
        "arrival": arrival,
        "sampled": sampled,
        "masked": masked,
    }
    if as_json:
        typer.echo(json.dumps(asked | found.to_json()))
    else:
        _print_survey(asked, found)


@app.command()
def interpret(
    name: BundleArgument,
    out: Annotated[Path, typer.Option(help="Folder to write to.")],
    episodes: Annotated[
        int | None, typer.Option(min=1, help="Episodes to count in; the task's own number if absent.")
    ] = None,
    seed: SeedOption = 0,
    png: Annotated[bool, typer.Option("--png", help="Write the figures as PNG too.")] = False,
    bundles: BundlesOption = BUNDLES,
) -> None:
    """Estimate what a bundle's tokens mean: lexicon.json, summary.json, tokens.csv and figures (SVG)."""
    from models.interpret import figures, tokens
    from models.interpret import summary as meaning_of
    from models.removal import EPISODES, removal

    held = _bundle(name, bundles)
    env = registry.make(held.manifest.task)
    meaning = meaning_of.interpret(env, held.policy, seed, episodes)
    out.mkdir(parents=True, exist_ok=True)
    numbers = meaning_of.summary(meaning)
    numbers["null_removed"] = removal(env, held.policy, meaning.lexicon, episodes or EPISODES, seed)
    _write_json(out / "lexicon.json", meaning.lexicon.to_json())
    _write_json(out / "summary.json", numbers)
    tokens.write(meaning, out / "tokens.csv")
    written = figures.write(figures.figures(env, meaning), out, png=png)
    _print_meaning(held, numbers)
    names = ", ".join(path.name for path in written)
    typer.echo(f"written to {out}: lexicon.json, summary.json, tokens.csv, {names}")


@app.command("figures")
def paper_figures(
    out: Annotated[Path, typer.Option(help="Folder to write to.")],
    episodes: Annotated[
        int | None, typer.Option(min=1, help="Episodes to count in; each task's own number if absent.")
    ] = None,
    seed: SeedOption = 0,
    png: Annotated[bool, typer.Option("--png", help="Write the figures as PNG too.")] = False,
    bundles: BundlesOption = BUNDLES,
) -> None:
    """Draw the paper's figures from the released agents (SVG), with a README.md of their numbers."""
    from models import gallery

    held = {name: _bundle(name, bundles) for name in gallery.AGENTS}
    for path in gallery.draw(held, out, seed, episodes, png=png):
        typer.echo(f"written: {path}")


@app.command()
def release(
    run_dir: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="Folder of a finished hatlab train.")],
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Name of the bundle; the recipe's own if absent.")
    ] = None,
    episodes: Annotated[int, typer.Option(min=1, help="Episodes of each evaluation.")] = 5_000,
    bundles: BundlesOption = BUNDLES,
) -> None:
    """Make a bundle of a run: weights, lexicon, evaluation, card."""
    from models import release as releasing
    from models.policies.bundle import BundleError
    from models.training import RecipeError, TrainingError
    from models.training.checkpoint import CheckpointError

    if name is not None:
        _check_name(name)
    try:
        made = releasing.release(run_dir, name, bundles, episodes)
    except (releasing.ReleaseError, BundleError, RecipeError, TrainingError, CheckpointError) as error:
        _refuse(error)
    typer.echo(f"{bundles / made.name}: sha256 {made.sha256}")


@app.command("import")
def bring(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="policy.toml and weights.safetensors or weights.npz.")
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the bundle: task_folder/name-1.")],
    episodes: Annotated[int, typer.Option(min=1, help="Episodes of each evaluation.")] = 5_000,
    bundles: BundlesOption = BUNDLES,
) -> None:
    """Make a bundle of a policy that was trained elsewhere, as release does of a run."""
    from models import imported, release
    from models.policies.bundle import BundleError

    _check_name(name)
    try:
        made = imported.bring(folder, name, bundles, episodes)
    except (imported.ForeignError, release.ReleaseError, BundleError) as error:
        _refuse(error)
    typer.echo(f"{bundles / made.name}: sha256 {made.sha256}")


@app.command()
def reproduce(
    table: Annotated[
        str, typer.Argument(metavar="TABLE", help="table1, table2, parent-child, human, or a TOML file.")
    ],
    jobs: Annotated[int, typer.Option(min=1, help="Agents that are trained at once.")] = 1,
    only: Annotated[str, typer.Option(help="Recipes (or recipe-seed) to run, as a pattern: easy-*.")] = "*",
    seeds: Annotated[
        str | None, typer.Option(help="Seeds to run: 1,2.", show_default="those of the table")
    ] = None,
    run: Annotated[bool, typer.Option("--run/--no-run", help="--no-run only writes the table again.")] = True,
    force: Annotated[bool, typer.Option("--force", help="Run them although they are stored.")] = False,
    out: Annotated[Path, typer.Option(help="Folder of tables and stored cells.")] = Path("docs/tables"),
    runs: Annotated[Path, typer.Option(help="Folder of runs.")] = Path("runs"),
    recipes: Annotated[
        Path, typer.Option(help="Folder of recipes.", show_default="the packaged ones")
    ] = RECIPES,
    bundles: BundlesOption = BUNDLES,
) -> None:
    """Train and measure what is missing of a table, then write it; exit 1 if anything failed."""
    from models.reproduce import cells, crew, publish, tables

    try:
        asked = tables.load(table)
        wanted = asked.cells(only, _numbers(seeds))
    except tables.TableError as error:
        _refuse(error)
    if run and not wanted:
        _refuse(f"{table}: no cell fits --only {only} --seeds {seeds or 'of the table'}")
    shelf = cells.Shelf(recipes, runs, out / "cells", bundles, asked.episodes)
    report = crew.run(shelf, jobs, wanted, force=force) if run else crew.Report()
    for path in publish.write(asked, shelf, out):
        typer.echo(f"written: {path}")
    if run:
        typer.echo(str(report))
    raise typer.Exit(FAILED if report.failed else 0)


@app.command("bundles")
def list_bundles(bundles: BundlesOption = BUNDLES) -> None:
    """List and verify all bundles; exit 1 if any is broken."""
    from rich.table import Table

    from models.policies import bundle

    if not bundles.is_dir():
        _refuse(f"{bundles}: no such folder")
    found, errors = bundle.find(bundles)
    table = Table("bundle", "task", "channel", "tokens", "gate", "budget", "sha256", box=None, pad_edge=False)
    for held in found.values():
        of = held.manifest
        row = (
            held.name,
            of.task,
            of.channel,
            of.sizes["tokens"],
            of.gate,
            f"{of.budget:g}",
            held.sha256[:12],
        )
        table.add_row(*map(str, row))
    _print_table(table)
    for line in errors:
        typer.echo(line, err=True)
    raise typer.Exit(FAILED if errors else 0)


def _check_name(name: str) -> None:
    from models.policies import bundle

    if not bundle.NAME.fullmatch(name):
        _refuse(f"name {name!r} is not of the form task_folder/name-1")


def _refuse(reason: object) -> NoReturn:
    """Say in one line what is wrong with the input, and leave."""
    typer.echo(" ".join(str(reason).split()), err=True)
    raise typer.Exit(BAD_INPUT)


def _fail(reason: object) -> NoReturn:
    """Say in one line why what had begun stopped, and leave."""
    typer.echo(" ".join(str(reason).split()), err=True)
    raise typer.Exit(FAILED)


def _numbers(text: str | None) -> tuple[int, ...] | None:
    if text is None:
        return None
    if not all(part.strip().isdecimal() for part in text.split(",")):
        _refuse(f"--seeds {text}: whole numbers with commas between them, such as 1,2")
    return tuple(int(part) for part in text.split(","))


def _recipe_path(recipe: str) -> Path:
    path, packaged = Path(recipe), RECIPES / f"{recipe}.toml"
    if path.exists():
        return path
    if packaged.exists():
        return packaged
    known = ", ".join(sorted(file.stem for file in RECIPES.glob("*.toml")))
    _refuse(f"{recipe}: no such file; packaged recipes: {known}")


def _own_recipe(source: Path, folder: Path, seed: int | None, *, keep: bool) -> Path:
    """Copy the recipe into the run's folder, with another seed if asked for; one to be kept stays."""
    from models.training.held import with_seed

    own = folder / "recipe.toml"
    if own.exists() and keep:
        return own
    folder.mkdir(parents=True, exist_ok=True)
    if not (own.exists() and own.samefile(source)):
        shutil.copyfile(source, own)
    if seed is not None:
        text = own.read_text(encoding="utf-8")
        own.write_text(with_seed(text, seed), encoding="utf-8")
    return own


def _bundle(name: str, root: Path) -> PolicyBundle:
    from models.policies import bundle

    folder = Path(name) if Path(name).is_dir() else root / name
    if not folder.is_dir():
        known = sorted(path.parent.relative_to(root).as_posix() for path in root.glob("*/*/manifest.json"))
        _refuse(f"{name}: no such bundle; known ones: {', '.join(known) or 'none'}")
    try:
        return bundle.load(folder)
    except bundle.BundleError as error:
        _refuse(f"{name}/{error}")


def _players(policy: str, task: str | None, root: Path, draws: int | None) -> tuple[Environment[Any], Any]:
    """World and players of an evaluation."""
    from models.policies.api import GeneratorDraws
    from models.policies.team import Team

    if policy.startswith("scripted:"):
        if task is None:
            _refuse(f"{policy} needs --task: one of {', '.join(registry.NAMES)}")
        try:
            return registry.make(task), scripted.make(policy)
        except (registry.UnknownTaskError, scripted.UnknownScriptedError) as error:
            _refuse(error)
    name, own, mind = _mind(policy, root)
    if task is not None and task != own:
        _refuse(f"{name} was trained for {own}, not {task}; leave out --task")
    env = registry.make(own)
    return env, Team(env, mind, None if draws is None else GeneratorDraws(draws))


def _mind(policy: str, root: Path) -> tuple[str, str, Policy]:
    """Name, task and policy of a bundle or of the folder of a run."""
    from models.training import RecipeError, held
    from models.training.checkpoint import CheckpointError

    if not (Path(policy) / held.RECIPE).is_file():
        released = _bundle(policy, root)
        return released.name, released.manifest.task, released.policy
    try:
        run = held.read(Path(policy))
    except (held.RunError, RecipeError, CheckpointError) as error:
        _refuse(error)
    return policy, run.recipe.task, run.policy


def _write_json(path: Path, data: dict[str, Any]) -> None:
    path.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _print_survey(asked: dict[str, Any], found: Survey) -> None:
    from rich.table import Table

    said = [f"{key} {value}" for key, value in asked.items() if value is not None and value is not False]
    typer.echo(", ".join(said))
    table = Table("measure", "mean", "95 % from", "to", box=None, pad_edge=False)
    rows = found.measures | {
        f"seat {one.seat} collided{' (participant)' if one.participant else ''}": one.collided
        for one in found.seats
    }
    for name, measure in rows.items():
        low, high = measure.ci95
        table.add_row(name, f"{measure.mean:.4f}", f"{low:.4f}", f"{high:.4f}")
    _print_table(table)
    if found.bursts is not None:
        single = ", ".join(f"{name} {value:.3f}" for name, value in found.bursts.single_quantiles.items())
        typer.echo(f"message rate in 5 steps: {found.bursts.least:.3f} to {found.bursts.most:.3f}")
        typer.echo(f"... in 5 steps of one episode: {single}")


def _print_table(table: Table) -> None:
    """Print at full width where nobody's window sets one, so that names can be searched for."""
    from rich.console import Console

    width = None if sys.stdout.isatty() else TABLE_WIDTH
    Console(width=width).print(table)


def _print_meaning(held: PolicyBundle, numbers: dict[str, Any]) -> None:
    from models.card import meaning_lines

    typer.echo(
        f"{held.name}: {numbers['messages']:,} messages, "
        f"{numbers['tokens_in_use']} of {numbers['tokens']} tokens in use, {numbers['null_tokens']} null"
    )
    for line in meaning_lines(numbers):
        typer.echo(line)
    if "left_out" in numbers:
        typer.echo(f"{held.manifest.task}: {numbers['left_out']}")
