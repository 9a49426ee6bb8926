"""Connections to marketplaces, by the settings; without an account there is a clear refusal."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING

from server.domain.errors import BadInputError, NotReadyError
from server.domain.money import reward_minor
from server.domain.reconciliation import Site
from server.domain.study import Pay, StudyDefinition
from server.recruitment.recruiter import RecruiterError
from server.services.lab import Lab
from server.settings import Settings
from server.storage import postings

if TYPE_CHECKING:
    from server.recruitment.mturk_api import MTurkRecruiter
    from server.recruitment.prolific_api import ProlificRecruiter
    from server.recruitment.recruiter import Recruiter

NAMES = {"prolific": "Prolific", "mturk": "Mechanical Turk"}
SITES = {"prolific": Site(), "mturk": Site(lists_everybody=False, pays_in_parts=False)}


def promised_minor(pay: Pay, marketplace: str, status: str, code: str) -> int:
    """What somebody of this status gets for their time, as far as the marketplace they came from allows.

    Where nothing is paid in parts, whoever hands in a code gets the whole reward, and nobody else anything.
    """
    if SITES.get(marketplace, Site()).pays_in_parts:
        return reward_minor(pay, status)
    return pay.reward_minor if code else 0


def is_connected(settings: Settings, marketplace: str) -> bool:
    """Whether the settings name an account there."""
    if marketplace == "prolific":
        return settings.prolific_token is not None
    keys = (settings.mturk_access_key_id, settings.mturk_secret_access_key)
    return marketplace == "mturk" and None not in keys


def must_be_connected(settings: Settings, marketplace: str) -> None:
    if not is_connected(settings, marketplace):
        raise NotReadyError(f"no account at {NAMES.get(marketplace, marketplace)}: see docs/settings.md")


@contextmanager
def recruiter(lab: Lab, marketplace: str, study: StudyDefinition) -> Iterator["Recruiter"]:
    """A connection for one piece of work.

    Raises:
        NotReadyError: no account is set up, or the settings of it cannot be used.
    """
    must_be_connected(lab.settings, marketplace)
    try:
        opened = mturk(lab) if marketplace == "mturk" else prolific(lab.settings, study)
    except RecruiterError as error:
        raise NotReadyError(str(error)) from error
    with closing(opened):
        yield opened


def prolific(settings: Settings, study: StudyDefinition) -> "ProlificRecruiter":
    from server.recruitment.prolific_api import ProlificRecruiter
    from server.recruitment.prolific_http import Connection

    assert settings.prolific_token is not None
    return ProlificRecruiter(
        Connection(settings.prolific_api, settings.prolific_token),
        screen_out_minor=study.pay.screen_out_minor if study.pay else None,
        settle_s=settings.prolific_settle_s,
    )


def mturk(lab: Lab) -> "MTurkRecruiter":
    """MTurk does not say who holds an assignment; our own rows do."""
    from server.recruitment.mturk_api import MTurkRecruiter
    from server.recruitment.mturk_client import MTurkClient

    settings = lab.settings
    assert settings.mturk_access_key_id is not None
    assert settings.mturk_secret_access_key is not None
    client = MTurkClient(
        settings.mturk_endpoint, settings.mturk_access_key_id, settings.mturk_secret_access_key
    )

    def worker_of(submission_id: str) -> str | None:
        with lab.database.reading() as db:
            return postings.external_id_of_submission(db, "mturk", submission_id)

    return MTurkRecruiter(client, settings.mturk_endpoint, worker_of)


def prolific_webhook(settings: Settings, workspace: str | None) -> tuple[str, str]:
    """Have Prolific tell this server of changes; the address that it tells, and the secret it signs with.

    Raises:
        NotReadyError: no account is set up, or Prolific refused.
        BadInputError: there are several workspaces and none, or none of them, was named.
    """
    from server.recruitment.prolific_http import Connection
    from server.recruitment.prolific_webhook import subscribe, workspaces

    must_be_connected(settings, "prolific")
    assert settings.prolific_token is not None
    target = f"{settings.public_url}/hooks/prolific"
    with closing(Connection(settings.prolific_api, settings.prolific_token)) as connection:
        try:
            known = workspaces(connection)
            if workspace not in known and (workspace is not None or len(known) != 1):
                listed = ", ".join(f"{key} ({title})" for key, title in known.items()) or "none"
                raise BadInputError(f"name one workspace of the account with --workspace: {listed}")
            made = subscribe(connection, workspace or next(iter(known)), target)
        except RecruiterError as error:
            raise NotReadyError(str(error)) from error
    return target, made.secret.get_secret_value()
