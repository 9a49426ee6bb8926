"""Connections to marketplaces, by the settings; without an account there is a clear refusal."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from server.domain.errors import NotReadyError
from server.domain.study import StudyDefinition
from server.services.lab import Lab
from server.settings import Settings

if TYPE_CHECKING:
    from server.recruitment.recruiter import Recruiter

NAMES = {"prolific": "Prolific"}


def is_connected(settings: Settings, marketplace: str) -> bool:
    """Whether the settings name an account there."""
    return marketplace == "prolific" and settings.prolific_token is not None


@contextmanager
def recruiter(lab: Lab, marketplace: str, study: StudyDefinition) -> Iterator["Recruiter"]:
    """A connection for one piece of work.

    Raises:
        NotReadyError: no account is set up.
    """
    settings = lab.settings
    if not is_connected(settings, marketplace):
        raise NotReadyError(f"no account at {NAMES.get(marketplace, marketplace)}: see docs/settings.md")
    from server.recruitment.prolific_api import ProlificRecruiter
    from server.recruitment.prolific_http import Connection

    assert settings.prolific_token is not None
    connection = Connection(settings.prolific_api, settings.prolific_token)
    pay = study.pay
    opened = ProlificRecruiter(
        connection,
        screen_out_minor=pay.screen_out_minor if pay else None,
        settle_s=settings.prolific_settle_s,
    )
    try:
        yield opened
    finally:
        opened.close()
