"""The command line: `hatlab init | serve | verify | export | …`, and the commands of models.cli.

Exit code 0: done; 1: the check failed; 2: bad input, said in one line on stderr. What is slow to import is
imported by the command that needs it; `hatlab serve` never loads training.
"""

import gc
import sys
import time
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from pydantic import ValidationError
from typer.core import TyperGroup
from typer.exceptions import Abort, TyperException

from server.domain.errors import BadInputError, HatlabError, NotReadyError

if TYPE_CHECKING:
    from server.services.lab import Lab
    from server.settings import Settings

MODELS_COMMANDS = (
    "train",
    "pack",
    "evaluate",
    "interpret",
    "figures",
    "bundles",
    "release",
    "import",
    "reproduce",
)
REFUSALS = {
    "models.envs.registry": "UnknownTaskError",
    "models.policies.bundle": "BundleError",
    "server.simulate.crowd": "UnreachableError",
}
BAD_INPUT = 2


class Style(StrEnum):
    SENSIBLE = "sensible"
    RANDOM = "random"
    MIXED = "mixed"


class Commands(TyperGroup):
    """The server's commands, and those of models.cli, which is imported when one of them is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 (the signature is typer's)
        return [*self.commands, *MODELS_COMMANDS]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name in MODELS_COMMANDS:
            from models.cli import app as models_app

            group = typer.main.get_command(models_app)
            assert isinstance(group, TyperGroup)
            return group.commands.get(cmd_name)
        return super().get_command(ctx, cmd_name)


app = typer.Typer(
    cls=Commands,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
Slug = Annotated[
    str, typer.Argument(metavar="STUDY", help="The study's name in its link, like parent-child.")
]


@app.callback()
def hatlab() -> None:
    """Human-agent-teaming experiments in the browser, with agents whose language emerged in self-play."""


@app.command()
def init() -> None:
    """Create or migrate the database. An empty one gets the paper's two studies (test mode) and an admin."""
    from server.services import accounts, lab, studies

    settings = settings_of_environment()
    lab.prepare(settings)
    opened = lab.Lab.without_agents(settings)
    with opened.database.writing() as db:
        password = accounts.ensure_admin(db, opened)
        made = studies.ensure_demo_studies(db, opened)
    opened.database.close()
    typer.echo(f"database ready: {opened.database.shown_url}")
    for slug in made:
        typer.echo(f"study made, open in test mode: {slug}")
    if password is not None:
        typer.echo(f"admin password (shown only now): {password}")


@app.command()
def serve(
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65_535, help="Port to listen on; 0: any free one.")] = 8000,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Processes that answer.")] = 1,
) -> None:
    """Serve participants and experimenters."""
    from server import serving

    settings = settings_of_environment()
    serving.serve(settings, host, port, workers)


@app.command()
def verify(
    study: Annotated[str | None, typer.Argument(metavar="[STUDY]", help="Only this study's trials.")] = None,
    audit: Annotated[
        bool, typer.Option(help="Also let the agents decide again, and count differences.")
    ] = False,
) -> None:
    """Replay every stored trial. Compare with what is stored; exit 1 naming the first difference of each."""
    from server.services.verify import verify as check

    report = check(open_lab(), study, audit)
    typer.echo(report.text)
    raise typer.Exit(0 if report.clean else 1)


@app.command()
def export(
    study: Slug,
    out: Annotated[Path, typer.Option(help="Folder to write to; must be empty or not there.")],
    mode: Annotated[
        list[str] | None, typer.Option(help="live (the default), test, preview or robot; may be repeated.")
    ] = None,
    practice: Annotated[bool, typer.Option(help="Also the practice rounds.")] = False,
) -> None:
    """Write the study's data as CSV, with a codebook and a manifest."""
    from server.services.export import export as write

    lab = open_lab()
    gc.freeze()  # millions of short-lived rows are to come; the libraries need not be searched each time
    manifest = write(lab, study, mode or (), out, practice=practice)
    for name, facts in manifest["files"].items():
        typer.echo(f"{facts['rows']:>9} rows  {out / name}")


@app.command()
def erase(
    study: Slug,
    participant: Annotated[
        str, typer.Option(metavar="P…", help="The person's code, as in exports and on the monitor.")
    ] = "",
    marketplace: Annotated[str, typer.Option(help="prolific or mturk; with --external-id.")] = "",
    external_id: Annotated[
        str, typer.Option(help="What the marketplace calls the person; also finds who declined.")
    ] = "",
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before deleting.")] = False,
) -> None:
    """Delete everything that is known of one person in a study, for good. Asks first."""
    from server.services import erase as erasing
    from server.services.lab import Lab

    if bool(participant) == bool(external_id) or bool(marketplace) != bool(external_id):
        raise BadInputError("name one person: --participant P…, or --marketplace M with --external-id ID")
    lab = Lab.without_agents(settings_of_environment())
    with lab.database.reading() as db:
        if participant:
            who = erasing.find_participant(db, lab, study, participant)
        else:
            who = erasing.find_external(db, lab, study, marketplace, external_id)
    typer.echo(who.text)
    if who.is_owed:
        typer.echo("No payment to this person is known here. Pay them first: nobody can afterwards.")
    if not yes and not typer.confirm("Delete all of this for good?"):
        typer.echo("nothing was deleted")
        raise typer.Exit(1)
    with lab.database.writing() as db:
        erasing.erase(db, who)
    lab.database.settle()
    typer.echo("deleted; copies in backups and in earlier exports are not")


@app.command()
def simulate(
    study: Slug,
    participants: Annotated[int, typer.Option(min=1, help="How many robots.")],
    seed: Annotated[int, typer.Option(help="Whatever they draw follows from it.")],
    url: Annotated[
        str | None, typer.Option(help="The server; default: this installation's public URL.")
    ] = None,
    style: Annotated[Style, typer.Option(help="How they play; mixed: in turn.")] = Style.SENSIBLE,
    concurrency: Annotated[int, typer.Option(min=1, max=1_000, help="How many play at once.")] = 20,
    rate: Annotated[
        float | None, typer.Option(min=0.001, help="Decisions a second of each; default: no pause.")
    ] = None,
) -> None:
    """Let robots walk the whole study over HTTP. Mode robot; exit 1 if one of them does not finish."""
    from itsdangerous import TimestampSigner
    from rich.console import Console

    from server.simulate.crowd import Crowd
    from server.simulate.report import run

    settings = settings_of_environment()
    signer = TimestampSigner(secret_key(settings), salt="robot")
    crowd = Crowd(
        study,
        participants,
        seed,
        url or settings.public_url,
        style.value,
        concurrency,
        rate,
        answers=right_answers(settings, study),
    )
    complete = run(crowd, lambda: signer.sign(study).decode(), Console())
    raise typer.Exit(0 if complete else 1)


@app.command()
def fake_prolific(
    port: Annotated[int, typer.Option(min=0, max=65_535, help="Port to listen on; 0: any free one.")] = 8010,
    seed: Annotated[int, typer.Option(help="Ids and mishaps follow from it.")] = 1,
    token: Annotated[str, typer.Option(help="The key that it accepts.")] = "fake-token",  # noqa: S107
    webhook_url: Annotated[
        str | None, typer.Option(help="Where changes of submissions are sent, sometimes twice or late.")
    ] = None,
    webhook_secret: Annotated[
        str | None, typer.Option(help="Secret that they are signed with; default: drawn and printed.")
    ] = None,
    limit_429: Annotated[
        float, typer.Option(min=0, max=1, help="Share of requests that are answered: too many.")
    ] = 0.0,
    delay: Annotated[
        float, typer.Option(min=0, max=60, help="Longest delay of an answer, in seconds.")
    ] = 0.0,
    lag: Annotated[
        float, typer.Option(min=0, max=3_600, help="Seconds until a code or a bonus arrives.")
    ] = 0.0,
) -> None:
    """Start a made-up Prolific on this machine, to try recruiting without money and people."""
    from server.simulate.fake_prolific import FakeProlific, serve
    from server.simulate.fake_prolific_hooks import Hooks
    from server.simulate.fake_prolific_market import Market
    from server.simulate.fake_prolific_weather import Weather

    fake = FakeProlific(
        token,
        Market(seed, publishing_s=1.0, submit_lag_s=lag, bonus_lag_s=lag),
        Weather(seed, limit_429=limit_429, delay_s=delay),
        Hooks(seed, secret=webhook_secret),
    )
    serve(fake, port, webhook_url)


@app.command()
def invite(
    study: Slug,
    names: Annotated[
        Path | None, typer.Option(help="File with one name a line; a name says in the data who took part.")
    ] = None,
    count: Annotated[int | None, typer.Option(min=1, max=10_000, help="Draw so many new names.")] = None,
    out: Annotated[Path | None, typer.Option(help="Write a CSV file instead of printing.")] = None,
) -> None:
    """Write a personal link for everybody on a list. The same name always gets the same link."""
    from server.recruitment import personal
    from server.services import lab, sheets, studies

    if (names is None) == (count is None):
        raise BadInputError("say who is invited: either --names FILE or --count N")
    here = lab.Lab.without_agents(settings_of_environment())
    with here.database.reading() as db:
        studies.find(db, study)
    here.database.close()
    try:
        people = personal.drawn(count or 0) if names is None else personal.names_in(lines_of(names))
        codes = {name: personal.code_of(name, study, here.secret_key) for name in people}
    except ValueError as error:
        raise BadInputError(str(error)) from error
    rows = [(name, personal.link(here.settings.public_url, study, code)) for name, code in codes.items()]
    if out is None:
        typer.echo("\n".join("\t".join(row) for row in rows))
    else:
        out.write_bytes(sheets.plain(("name", "link"), rows))
        typer.echo(f"{len(rows)} links: {out}")


@app.command()
def poll(
    study: Annotated[
        str | None, typer.Argument(metavar="[STUDY]", help="Only this study's postings, also in test mode.")
    ] = None,
    every: Annotated[
        float | None, typer.Option(min=5, metavar="SECONDS", help="Ask again and again, until interrupted.")
    ] = None,
) -> None:
    """Ask the marketplaces how each posting stands, and take it in. Exit 1 if one could not be asked."""
    from server.services.lab import Lab
    from server.services.poll import poll as ask

    lab = Lab.without_agents(settings_of_environment())
    while True:
        done = []
        for asked in ask(lab, study):
            typer.echo(asked.text)
            done.append(asked.submissions is not None)
        if not done:
            typer.echo("no posting to ask about")
        if every is None:
            raise typer.Exit(0 if all(done) else 1)
        time.sleep(every)


@app.command(name="prolific-webhook")
def prolific_webhook(
    workspace: Annotated[
        str | None, typer.Option(help="Id of the Prolific workspace, where the account has several.")
    ] = None,
) -> None:
    """Have Prolific tell this server of changes at once, and print the secret that the server needs."""
    from server.services.recruiters import prolific_webhook as subscribed

    target, secret = subscribed(settings_of_environment(), workspace)
    typer.echo(f"Prolific tells {target} of changes. Give the server its secret, and start it again:")
    typer.echo(f"HATLAB_PROLIFIC_WEBHOOK_SECRET={secret}")


def lines_of(path: Path) -> list[str]:
    """A text file's lines, whatever system wrote it.

    Raises:
        BadInputError: there is no such text file.
    """
    try:
        return path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeError) as error:
        raise BadInputError(f"cannot read {path}: it must be a text file in UTF-8") from error


@app.command(name="fake-mturk")
def fake_mturk(
    port: Annotated[int, typer.Option(min=0, max=65_535, help="Port to listen on; 0: any free one.")] = 8100,
    seed: Annotated[int, typer.Option(help="Its ids and delays follow from it.")] = 0,
    delay: Annotated[float, typer.Option(min=0, help="Seconds until MTurk shows a submission.")] = 0.0,
    throttle: Annotated[int, typer.Option(min=0, help="Refuse each so many-th request as busy.")] = 0,
) -> None:
    """Serve a Mechanical Turk of your own on loopback: requester API, worker site, ledger; nobody is paid."""
    import uvicorn

    from server import serving
    from server.simulate.fake_mturk import announcement
    from server.simulate.fake_mturk import fake_mturk as fake
    from server.simulate.mturk_market import Market

    place = serving.listen("127.0.0.1", port)
    typer.echo(announcement(place.listener.getsockname()[1]))
    site = fake(Market(seed, delay), throttle)
    uvicorn.Server(serving.config(settings_of_environment(), site)).run([place.listener])


def settings_of_environment() -> "Settings":
    from server.settings import Settings

    return Settings()


def open_lab() -> "Lab":
    from server.services.lab import Lab

    return Lab.open(settings_of_environment())


def secret_key(settings: "Settings") -> str:
    """The key that robots are signed with: the setting, or the one in this installation's database."""
    from server.services.lab import secret_of
    from server.storage.database import Database

    if settings.secret_key is not None:
        return settings.secret_key.get_secret_value()
    database = Database(settings.database_url)
    if not database.is_current():
        raise NotReadyError("no secret key to sign robots with: set HATLAB_SECRET_KEY or run `hatlab init`")
    return secret_of(settings, database)


def right_answers(settings: "Settings", slug: str) -> dict[str, str]:
    """What robots answer to quiz and attention checks, from this database; empty without it."""
    from server.domain.study import answer_key, from_json
    from server.storage import studies
    from server.storage.database import Database

    database = Database(settings.database_url)
    if not database.is_current():
        return {}
    with database.reading() as db:
        row = studies.by_slug(db, slug)
        version = studies.newest_version(db, row.id) if row else None
    database.close()
    return answer_key(from_json(version.definition)) if version else {}


def main() -> None:
    """Run the command line; every bad input becomes one line and exit code 2."""
    try:
        code = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except TyperException as error:
        code = refuse(error.format_message())
    except HatlabError as error:
        code = refuse(error.detail)
    except ValidationError as error:
        code = refuse(settings_error(error))
    except Abort:
        code = 130
    except Exception as error:
        if not is_refusal(error):
            raise
        code = refuse(str(error))
    sys.exit(code if isinstance(code, int) else 0)


def refuse(reason: str) -> int:
    """One line on stderr."""
    print("hatlab:", " ".join(reason.split()), file=sys.stderr)
    return BAD_INPUT


def is_refusal(error: Exception) -> bool:
    """Whether it is one of the errors by which other parts refuse input, without importing those parts."""
    return any(
        isinstance(error, getattr(sys.modules[module], name))
        for module, name in REFUSALS.items()
        if module in sys.modules
    )


def settings_error(error: ValidationError) -> str:
    """The first wrong setting by its variable's name; the value may be a secret and is not repeated."""
    first = error.errors()[0]
    return f"HATLAB_{'_'.join(str(part) for part in first['loc']).upper()}: {first['msg']}"


if __name__ == "__main__":
    main()
