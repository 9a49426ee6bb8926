"""A study inside MTurk's frame, in real Chromium that keeps no third-party cookies.

The fake is another site than the server (localhost and 127.0.0.1), as MTurk is.
"""

import re
import sqlite3
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from pydantic import SecretStr

from server.recruitment.mturk_api import MTurkRecruiter
from server.recruitment.mturk_client import MTurkClient
from server.recruitment.recruiter import Posting
from tests.e2e.laboratory import HATLAB, ROOT, Laboratory, free_port, laboratory, stop

pytestmark = pytest.mark.browser

ARTEFACTS = ROOT / "artefacts" / "e2e"
VISIT_S = 240
COUNTED = ("participant", "identity", "consent", "trial", "event")


@dataclass(frozen=True)
class Recruited:
    lab: Laboratory
    site: str
    recruiter: MTurkRecruiter
    posting: str

    def visit(self, what: str) -> str:
        """What the browser printed last."""
        ARTEFACTS.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(
            ("node", "tests/e2e/mturk.mjs", what, self.site, self.lab.url, str(ARTEFACTS)),
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=VISIT_S,
            check=False,
        )
        assert done.returncode == 0, done.stderr + (self.lab.folder / "server.log").read_text()[-2000:]
        return done.stdout.strip()

    def rows(self) -> dict[str, int]:
        with sqlite3.connect(self.lab.database) as db:
            return {name: db.execute(f"SELECT count(*) FROM {name}").fetchone()[0] for name in COUNTED}


@pytest.fixture(scope="module")
def recruited(browser: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Recruited]:
    """A server and a fake MTurk, told of each other as `hatlab fake-mturk` says, and a published study."""
    command = (*HATLAB, "fake-mturk", "--port", str(free_port()))
    fake = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert fake.stdout is not None
        said = [fake.stdout.readline().strip() for _ in range(5)]
        settings = dict(line.split("=", 1) for line in said[1:])
        with laboratory(tmp_path_factory.mktemp("laboratory"), **settings) as lab:
            client = MTurkClient(
                settings["HATLAB_MTURK_ENDPOINT"],
                SecretStr(settings["HATLAB_MTURK_ACCESS_KEY_ID"]),
                SecretStr(settings["HATLAB_MTURK_SECRET_ACCESS_KEY"]),
            )
            recruiter = MTurkRecruiter(client, settings["HATLAB_MTURK_ENDPOINT"])
            posting = recruiter.publish(recruiter.create(posting_of(lab)).id).id
            yield Recruited(lab, settings["HATLAB_MTURK_EXTRA_HOST"], recruiter, posting)
            client.close()
    finally:
        stop(fake)
        if fake.stdout is not None:
            fake.stdout.close()


def posting_of(lab: Laboratory) -> Posting:
    return Posting(
        slug="short-traffic",
        title="Drive through a crossing",
        description="Four short rounds.",
        entry_url=f"{lab.url}/s/short-traffic",
        places=10,
        duration_min=5,
        time_limit_min=60,
        reward_minor=100,
        currency="USD",
        codes={},
    )


def test_a_preview_inside_the_frame_stores_nothing(recruited: Recruited) -> None:
    before = recruited.rows()
    recruited.visit("preview")
    assert recruited.rows() == before
    assert recruited.recruiter.submissions(recruited.posting) == []


def test_a_worker_takes_part_inside_the_frame_and_hands_the_code_in(recruited: Recruited) -> None:
    code = recruited.visit("work")
    assert re.fullmatch(r"\S{4,}", code)
    (submission,) = recruited.recruiter.submissions(recruited.posting)
    assert (submission.external_id, submission.code, submission.state) == ("AEVA", code, "awaiting_review")
    with sqlite3.connect(recruited.lab.database) as db:
        stored = db.execute(
            "SELECT identity.marketplace, status, completion_code, submission_id, external_id"
            " FROM participant JOIN identity ON participant_id = participant.id"
        ).fetchall()
    assert stored == [("mturk", "finished", code, submission.id, "AEVA")]
