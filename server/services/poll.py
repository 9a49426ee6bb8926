"""Asking marketplaces how everything stands: what the button in Recruitment does, for every posting."""

from collections.abc import Iterator
from dataclasses import dataclass

from server.domain.errors import NotReadyError
from server.services import recruit
from server.services.lab import Lab
from server.services.recruit import MarketplaceError
from server.services.recruiters import NAMES
from server.services.studies import find
from server.storage import postings, studies
from server.storage.database import DbSession

LIVE = "live"


@dataclass(frozen=True, slots=True)
class Asked:
    """What came of asking about one posting."""

    study: str
    marketplace: str
    external_id: str
    submissions: int | None
    """How many there are; None: the marketplace could not be asked."""
    problem: str = ""

    @property
    def text(self) -> str:
        """In one line."""
        found = f"{self.submissions} submission{'' if self.submissions == 1 else 's'}"
        told = self.problem if self.submissions is None else found
        return f"{self.study}  {self.marketplace} {self.external_id}: {' '.join(told.split())}"


@dataclass(frozen=True, slots=True)
class Target:
    """A posting that is to be asked about."""

    study: str
    marketplace: str
    external_id: str
    posting_id: int


def poll(lab: Lab, slug: str | None) -> Iterator[Asked]:
    """Ask about every posting of a study, or of all studies in live mode, and take in what is told.

    Raises:
        NotFoundError: no study is called so.
    """
    with lab.database.reading() as db:
        found = targets(db, slug)
    return (ask(lab, each) for each in found)


def targets(db: DbSession, slug: str | None) -> list[Target]:
    rows = [find(db, slug).row] if slug is not None else [s for s in studies.every(db) if s.mode == LIVE]
    return [
        Target(row.slug, each.marketplace, each.external_id, each.id)
        for row in rows
        for each in postings.of_study(db, row.id)
    ]


def ask(lab: Lab, target: Target) -> Asked:
    """Ask about one posting; a marketplace that does not answer keeps nobody from asking the next."""
    name = NAMES.get(target.marketplace, target.marketplace)
    try:
        told = recruit.poll(lab, target.posting_id)
    except (MarketplaceError, NotReadyError) as error:
        return Asked(target.study, name, target.external_id, None, error.detail)
    return Asked(target.study, name, target.external_id, told)
