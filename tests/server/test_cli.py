"""The command line as a user types it: exit codes, one-line refusals, and what init leaves behind."""

import csv
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import httpx
import pytest
import typer
from typer.core import TyperGroup

from server.cli import MODELS_COMMANDS
from server.services import enrol
from server.services.lab import Lab
from server.settings import Settings
from server.storage import postings
from tests.server.services.steps import DESKTOP, prolific

REPOSITORY = Path(__file__).parents[2]
PASSWORD = "correct horse"


class Shell:
    """Runs `hatlab` in its own process against a database in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.settings = {"HATLAB_DATABASE_URL": f"sqlite:///{folder}/var/hatlab.sqlite3"}

    def __call__(self, *words: str, **settings: str) -> subprocess.CompletedProcess[str]:
        with self.started(*words, **settings) as process:
            out, err = process.communicate(timeout=120)
        return subprocess.CompletedProcess(words, process.returncode, out, err)

    def started(self, *words: str, **settings: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-c", "from server.cli import main; main()", *words],
            cwd=self.folder,
            env={"PYTHONPATH": str(REPOSITORY), "PATH": "/usr/bin:/bin", **self.settings, **settings},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )


@pytest.fixture(name="hatlab")
def shell_in_an_empty_folder(tmp_path: Path) -> Shell:
    return Shell(tmp_path)


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which `hatlab init` was run."""
    folder = tmp_path_factory.mktemp("initialised")
    assert Shell(folder)("init").returncode == 0
    return folder


@pytest.fixture
def initialised(once: Path, tmp_path: Path) -> Shell:
    shutil.copytree(once, tmp_path, dirs_exist_ok=True)
    return Shell(tmp_path)


def test_init_makes_two_studies_and_a_password_once(hatlab: Shell) -> None:
    first = hatlab("init")
    assert first.returncode == 0, first.stderr
    assert "parent-child" in first.stdout
    assert "traffic-junction" in first.stdout
    assert "admin password" in first.stdout
    second = hatlab("init")
    assert second.returncode == 0
    assert "study made" not in second.stdout
    assert "password" not in second.stdout


def test_a_password_from_the_environment_is_not_printed(hatlab: Shell) -> None:
    done = hatlab("init", HATLAB_ADMIN_PASSWORD=PASSWORD)
    assert done.returncode == 0
    assert "admin password" not in done.stdout + done.stderr
    assert PASSWORD not in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nonsense",), "No such command"),
        (("export",), "Missing argument"),
        (("serve", "--port", "abc"), "--port"),
        (("serve",), "run `hatlab init`"),
        (("verify",), "run `hatlab init`"),
        (("invite", "parent-child", "--count", "1"), "run `hatlab init`"),
        (("invite", "parent-child"), "either --names FILE or --count N"),
        (("invite", "parent-child", "--count", "1", "--names", "x"), "either --names FILE or --count N"),
        (("export", "parent-child", "--out", "x"), "run `hatlab init`"),
        (("poll", "no-such-study"), "run `hatlab init`"),
        (("poll", "--every", "1"), "5"),
        (("prolific-webhook",), "no account at Prolific: see docs/settings.md"),
        (("erase", "parent-child"), "name one person"),
        (("erase", "parent-child", "--participant", "P1", "--marketplace", "m"), "name one person"),
        (("erase", "parent-child", "--external-id", "ada"), "name one person"),
        (("erase", "parent-child", "--participant", "P1"), "run `hatlab init`"),
        (("simulate", "parent-child", "--participants", "1", "--seed", "1"), "run `hatlab init`"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(hatlab: Shell, words: tuple[str, ...], said: str) -> None:
    done = hatlab(*words)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1, done.stderr
    assert said in done.stderr


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("HATLAB_TRIAL_CACHE", "-1"),
        ("HATLAB_ADMIN_PASSWORD", "short"),
        ("HATLAB_DATABASE_URL", "mysql://x/y"),
        ("HATLAB_MTURK_ENDPOINT", "nowhere"),
        ("HATLAB_MTURK_EXTRA_HOST", "http://localhost:8100; script-src *"),
        ("HATLAB_DATABASE_URL", "secret-typed-in-the-wrong-place"),
    ],
)
def test_a_setting_that_cannot_be_used_is_named_but_not_repeated(
    hatlab: Shell, name: str, value: str
) -> None:
    done = hatlab("init", **{name: value})
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert value not in done.stderr


def test_a_list_becomes_links_that_a_spreadsheet_opens_without_harm(initialised: Shell) -> None:
    (initialised.folder / "class.txt").write_bytes("\ufeffÄda\r\n\r\n=cmd()\r\n".encode())
    out = initialised.folder / "links.csv"
    done = initialised("invite", "parent-child", "--names", "class.txt", "--out", str(out))
    assert (done.returncode, done.stdout) == (0, f"2 links: {out}\n"), done.stderr
    header, *rows = csv.reader(out.read_text("utf-8").splitlines())
    assert header == ["name", "link"]
    assert [name for name, _ in rows] == ["Äda", "'=cmd()"]
    printed = initialised("invite", "parent-child", "--names", "class.txt").stdout.splitlines()
    assert [line.split("\t")[1] for line in printed] == [link for _, link in rows]
    assert all("/s/parent-child?invite=" in line for line in printed)
    drawn = [initialised("invite", "parent-child", "--count", "3").stdout.splitlines() for _ in range(2)]
    assert len({line for lines in drawn for line in lines}) == 6


@pytest.mark.parametrize(
    ("content", "said"),
    [("Ada\nAda\n", "stands there twice"), ("x" * 65, "cannot be a name"), (None, "cannot read")],
)
def test_a_list_that_cannot_be_used_is_refused(initialised: Shell, content: str | None, said: str) -> None:
    if content is not None:
        (initialised.folder / "class.txt").write_text(content)
    done = initialised("invite", "parent-child", "--names", "class.txt")
    assert done.returncode == 2
    assert done.stdout == ""
    assert said in done.stderr
    assert initialised("invite", "nobody", "--count", "1").returncode == 2


def test_the_fake_mturk_says_what_to_set_and_stops_when_told(hatlab: Shell) -> None:
    with hatlab.started("fake-mturk", "--port", "0") as fake:
        assert fake.stdout is not None
        first, *rest = (fake.stdout.readline().strip() for _ in range(5))
        told = dict(line.split("=", 1) for line in rest)
        assert set(told) == {
            f"HATLAB_{name.upper()}" for name in Settings.model_fields if name.startswith("mturk_")
        }
        settings = Settings(**{name.removeprefix("HATLAB_").lower(): value for name, value in told.items()})
        assert first.endswith(f"{settings.mturk_extra_host}/")
        assert "There is nothing to do" in httpx.get(f"{settings.mturk_endpoint}/", timeout=60).text
        fake.terminate()
        _, errors = fake.communicate(timeout=60)
    assert errors == ""


def test_an_unknown_study_is_named(initialised: Shell) -> None:
    done = initialised("export", "nobody", "--out", "x")
    assert done.returncode == 2
    assert "nobody" in done.stderr


def test_erasing_a_person_asks_first_and_says_if_there_is_nobody(initialised: Shell) -> None:
    hatlab = initialised
    words = ("erase", "traffic-junction", "--marketplace", "prolific", "--external-id", "ada")
    nobody = hatlab(*words)
    assert nobody.returncode == 2
    assert nobody.stdout == ""
    assert nobody.stderr == "hatlab: nobody in traffic-junction is known under that id of prolific\n"
    lab = Lab.without_agents(Settings(database_url=hatlab.settings["HATLAB_DATABASE_URL"]))
    with lab.database.writing() as db:
        enrol.consent(db, lab, "traffic-junction", prolific("ada"), agree=False, device=DESKTOP)
    lab.database.close()
    unsure = hatlab(*words)
    assert unsure.returncode == 130, "nobody answered the question"
    done = hatlab(*words, "--yes")
    assert done.returncode == 0, done.stderr
    assert "the note that they declined" in done.stdout
    assert "deleted" in done.stdout
    assert hatlab(*words).returncode == 2
    assert hatlab("verify").returncode == 0


def test_a_port_that_is_taken_is_said_before_anything_starts(initialised: Shell) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        done = initialised("serve", "--port", str(taken.getsockname()[1]))
    assert done.returncode == 2
    assert "choose another --host or --port" in done.stderr


def test_a_server_says_where_it_is_which_agent_it_left_out_and_stops_when_told(initialised: Shell) -> None:
    hatlab = initialised
    broken = hatlab.folder / "bundles" / "parent_child" / "broken"
    broken.mkdir(parents=True)
    (broken / "manifest.json").write_text("{")
    with hatlab.started("serve", "--port", "0", HATLAB_BUNDLES=str(hatlab.folder / "bundles")) as server:
        assert server.stdout is not None
        lines = [server.stdout.readline() for _ in range(4)]
        address = lines[0].split()[-1]
        assert f"{address}/s/parent-child" in lines[1]
        assert f"{address}/admin" in lines[3]
        assert httpx.get(f"{address}/healthz", timeout=60).json()["bundle_errors"]
        server.terminate()
        _, errors = server.communicate(timeout=60)
    assert errors.count("\n") == 1, errors
    assert "broken/manifest.json" in errors


def test_a_made_up_prolific_says_what_to_set_and_works_by_that(hatlab: Shell) -> None:
    with hatlab.started("fake-prolific", "--port", "0", "--webhook-url", "https://x.example/hook") as server:
        assert server.stdout is not None
        lines = [server.stdout.readline().strip() for _ in range(5)]
        told = dict(line.split(" ")[0].split("=", 1) for line in lines if line.startswith("HATLAB_"))
        answer = httpx.get(
            f"{told['HATLAB_PROLIFIC_API']}/hooks/subscriptions/",
            headers={"Authorization": f"Token {told['HATLAB_PROLIFIC_TOKEN']}"},
            timeout=60,
        )
        assert [each["target_url"] for each in answer.json()["results"]] == ["https://x.example/hook"]
        assert len(told["HATLAB_PROLIFIC_WEBHOOK_SECRET"]) == 64
        server.terminate()
        _, errors = server.communicate(timeout=60)
    assert errors == ""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--webhook-url", "http://elsewhere.example/"), "--webhook-url"),
        (("--limit-429", "2"), "--limit-429"),
    ],
)
def test_a_made_up_prolific_refuses_what_it_cannot_do(
    hatlab: Shell, words: tuple[str, ...], said: str
) -> None:
    done = hatlab("fake-prolific", "--port", "0", *words)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1, done.stderr


def test_every_command_of_the_science_is_mounted() -> None:
    from models.cli import app

    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    assert sorted(MODELS_COMMANDS) == sorted(group.commands)


def test_polling_says_of_each_posting_how_it_stands_and_by_its_exit_code_whether_all_could_be_asked(
    initialised: Shell,
) -> None:
    nothing = initialised("poll")
    assert (nothing.returncode, nothing.stdout) == (0, "no posting to ask about\n"), nothing.stderr
    unknown = initialised("poll", "no-such-study")
    assert (unknown.returncode, unknown.stderr.count("\n")) == (2, 1)
    lab = Lab.without_agents(Settings(database_url=initialised.settings["HATLAB_DATABASE_URL"]))
    with lab.database.writing() as db:
        postings.add(db, 1, "prolific", "abc", "active", 3, "{}", lab.now_utc())
    lab.database.close()
    in_test_mode = initialised("poll").stdout  # the paper's studies are: asked about only by name
    assert in_test_mode == "no posting to ask about\n"
    done = [initialised("poll", study) for study in ("parent-child", "traffic-junction")]
    assert sorted(each.returncode for each in done) == [0, 1]
    told = next(each.stdout for each in done if each.returncode)
    assert "Prolific abc: no account at Prolific" in told


def test_help_lists_the_commands_of_both_halves(hatlab: Shell) -> None:
    done = hatlab("--help")
    assert done.returncode == 0, done.stderr
    for command in (
        "init",
        "serve",
        "verify",
        "export",
        "erase",
        "poll",
        "prolific-webhook",
        "simulate",
        "fake-prolific",
        "invite",
        "fake-mturk",
        *MODELS_COMMANDS,
    ):
        assert command in done.stdout


def loaded_by(imports: str, *names: str) -> list[str]:
    """Modules that these imports load and whose names begin with one of these, in a new process."""
    code = f"import sys; {imports}; print(*(each for each in sys.modules if each.startswith({names})))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True, timeout=120
    )
    return done.stdout.split()


def test_commands_that_need_no_agent_do_not_wait_for_torch() -> None:
    commands = "from server.services import enrol, erase, poll, recruit, sheets, studies"
    assert loaded_by(f"import server.cli, models.cli; {commands}", "torch.", "safetensors") == []


def test_serving_never_loads_training() -> None:
    science = ("training", "interpret", "evaluate", "release", "cli")
    names = (*(f"models.{each}" for each in science), "server.simulate")
    assert loaded_by("import server.cli, server.serving", *names) == []
    assert loaded_by("import models.cli", "models.cli") == ["models.cli"]
