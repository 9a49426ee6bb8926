"""What several admin pages show: the frame around them, the head of a study, its participant links."""

from server.domain import canonical
from server.recruitment.prolific import PLACEHOLDERS
from server.services.lab import Lab
from server.services.studies import Study, how_many
from server.storage.database import DbSession
from server.web.admin_access import Visitor
from server.web.admin_pages import EntryLink, Frame, StudyHead


def frame(db: DbSession, lab: Lab, visitor: Visitor, section: str = "studies") -> Frame:
    return Frame(visitor.username, visitor.csrf, section, how_many(db), len(lab.bundles))


def head(study: Study, tab: str = "") -> StudyHead:
    version = study.version
    return StudyHead(
        slug=study.row.slug,
        title=study.row.title,
        status=study.row.status,
        mode=study.row.mode,
        tab=tab,
        version=version.number if version else None,
        sha256=version.sha256 if version else "",
        launched=minute(version.launched_utc) if version else "",
        has_draft=study.has_draft,
    )


def minute(utc: str) -> str:
    """A time that people read; a text that is no time stays as it is."""
    try:
        moment = canonical.utc_moment(utc)
    except ValueError:
        return utc
    return f"{moment.day} {moment:%b %Y, %H:%M} UTC"


def entry_links(lab: Lab, study: Study) -> tuple[EntryLink, ...]:
    """The links that participants open; none before the first launch."""
    if study.version is None:
        return ()
    url = f"{lab.settings.public_url}/s/{study.row.slug}"
    return (
        EntryLink("prolific", "Prolific", f"{url}?{PLACEHOLDERS}", "Prolific fills in the braces."),
        EntryLink(
            "mturk", "MTurk", url, "As ExternalURL of an ExternalQuestion; MTurk adds worker and assignment."
        ),
        EntryLink("direct", "Direct link", url, "For anybody; one session for each browser."),
    )
