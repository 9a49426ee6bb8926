"""Admin: what changes a study for participants. What cannot be undone asks first, on a page of its own."""

from collections.abc import Mapping

from fastapi import APIRouter, Depends
from fastapi.responses import RedirectResponse
from starlette.responses import Response

from server.domain.errors import BadInputError, DefinitionError, HatlabError
from server.domain.study import StudyDefinition
from server.services import studies
from server.services.lab import Lab
from server.services.studies import Study
from server.storage.database import DbSession
from server.web.admin_access import HOME, CheckedForm, CurrentVisitor, Visitor, signed_in
from server.web.admin_frame import frame, head
from server.web.admin_pages import ConfirmPage, NoticePage
from server.web.dependencies import CurrentLab
from server.web.rendering import html

RETURNS_HERE = (
    "The completion link leads to this machine, as for a made-up marketplace: nobody else can follow it."
)

router = APIRouter(dependencies=[Depends(signed_in)])


def address(slug: str, page: str = "") -> str:
    return f"/admin/studies/{slug}{page and '/' + page}"


def go(url: str) -> Response:
    return RedirectResponse(url, 303)


def refused(lab: Lab, visitor: Visitor, slug: str, error: HatlabError) -> Response:
    """What was asked for cannot be done; nothing was changed."""
    with lab.database.reading() as db:
        surround = frame(db, lab, visitor)
    page = NoticePage(surround, error.title, (error.detail,), address(slug), "Open the study")
    return html(page, error.status)


def ask(
    db: DbSession,
    lab: Lab,
    visitor: Visitor,
    study: Study,
    page: str,
    question: str,
    consequences: tuple[str, ...],
    button: str,
    *,
    fields: Mapping[str, str],
    danger: bool = False,
    definition: StudyDefinition | None = None,
) -> Response:
    """The page that asks before `page` is done."""
    return html(
        ConfirmPage(
            frame=frame(db, lab, visitor),
            head=head(study),
            question=question,
            consequences=consequences,
            action=address(study.row.slug, page),
            button=button,
            danger=danger,
            fields=fields,
            definition=definition,
        )
    )


@router.get("/admin/studies/{slug}/launch")
def ask_to_launch(lab: CurrentLab, visitor: CurrentVisitor, slug: str) -> Response:
    with lab.database.reading() as db:
        study = studies.find(db, slug)
        definition, errors = studies.judged(study.values, lab)
        if errors or not study.has_draft or definition is None:
            return go(address(slug))
        number = study.version.number + 1 if study.version else 1
        consequences = (
            f"Version {number} is frozen: it can never be changed. Later changes make version {number + 1}.",
            "The study opens: whoever has a participant link can enter.",
            *(("People who have entered stay in the version they entered.",) if study.version else ()),
            f"The study is in {study.row.mode} mode: who enters counts as {study.row.mode} data.",
            *((RETURNS_HERE,) if definition.returns_here else ()),
        )
        return ask(
            db,
            lab,
            visitor,
            study,
            "launch",
            f"Launch version {number}?",
            consequences,
            f"Launch version {number}",
            fields={"base": study.base},
            definition=definition,
        )


@router.post("/admin/studies/{slug}/launch")
def launch(lab: CurrentLab, visitor: CurrentVisitor, slug: str, fields: CheckedForm) -> Response:
    try:
        with lab.database.writing() as db:
            studies.launch(db, lab, slug, fields.get("base", ""))
    except DefinitionError:
        return go(address(slug))  # where each message stands at its field
    except studies.DraftChangedError as error:
        return refused(lab, visitor, slug, error)
    return go(address(slug, "monitor"))


@router.get("/admin/studies/{slug}/close")
def ask_to_close(lab: CurrentLab, visitor: CurrentVisitor, slug: str) -> Response:
    with lab.database.reading() as db:
        study = studies.find(db, slug)
        consequences = (
            "Nobody new can enter: they read that the study has ended. Whoever has entered can finish.",
            "What was collected stays, and can be downloaded.",
            "Recruitment on a marketplace is not stopped from here. Stop it there first.",
        )
        return ask(
            db,
            lab,
            visitor,
            study,
            "close",
            "Close this study?",
            consequences,
            "Close the study",
            fields={},
            danger=True,
        )


@router.post("/admin/studies/{slug}/close")
def close(lab: CurrentLab, visitor: CurrentVisitor, slug: str, fields: CheckedForm) -> Response:
    return with_status(lab, visitor, slug, "closed", fields)


@router.post("/admin/studies/{slug}/pause")
def pause(lab: CurrentLab, visitor: CurrentVisitor, slug: str, fields: CheckedForm) -> Response:
    return with_status(lab, visitor, slug, "paused", fields)


@router.post("/admin/studies/{slug}/open")
def open_again(lab: CurrentLab, visitor: CurrentVisitor, slug: str, fields: CheckedForm) -> Response:
    return with_status(lab, visitor, slug, "open", fields)


def with_status(lab: Lab, visitor: Visitor, slug: str, status: str, fields: Mapping[str, str]) -> Response:
    try:
        with lab.database.writing() as db:
            studies.set_status(db, slug, status)
    except BadInputError as error:
        return refused(lab, visitor, slug, error)
    return go(HOME if fields.get("back") == "list" else address(slug, "monitor"))


@router.get("/admin/studies/{slug}/mode")
def ask_for_mode(lab: CurrentLab, visitor: CurrentVisitor, slug: str) -> Response:
    with lab.database.reading() as db:
        study = studies.find(db, slug)
        live = study.row.mode == "test"
        consequences = (
            f"Who enters from now on counts as {'live' if live else 'test'} data.",
            "Who has entered stays what they are: test data never become live data.",
            "Places are counted anew: test participants hold no live place."
            if live
            else "Downloads leave test data out unless you ask for them.",
        )
        return ask(
            db,
            lab,
            visitor,
            study,
            "mode",
            "Collect live data from now on?" if live else "Go back to test mode?",
            consequences,
            "Go live" if live else "Back to test mode",
            fields={"mode": "live" if live else "test"},
        )


@router.post("/admin/studies/{slug}/mode")
def set_mode(lab: CurrentLab, visitor: CurrentVisitor, slug: str, fields: CheckedForm) -> Response:
    try:
        with lab.database.writing() as db:
            studies.set_mode(db, slug, fields.get("mode", ""))
    except BadInputError as error:
        return refused(lab, visitor, slug, error)
    return go(address(slug, "monitor"))


@router.get("/admin/studies/{slug}/discard")
def ask_to_discard(lab: CurrentLab, visitor: CurrentVisitor, slug: str) -> Response:
    with lab.database.reading() as db:
        study = studies.find(db, slug)
        if not study.has_draft or study.version is None:
            return go(address(slug))
        number = study.version.number
        consequences = (
            f"The changes since version {number} are deleted and cannot be brought back.",
            f"Version {number} and its data stay as they are.",
        )
        return ask(
            db,
            lab,
            visitor,
            study,
            "discard",
            f"Discard the draft of version {number + 1}?",
            consequences,
            "Discard the draft",
            fields={"base": study.base},
            danger=True,
        )


@router.post("/admin/studies/{slug}/discard")
def discard(lab: CurrentLab, visitor: CurrentVisitor, slug: str, fields: CheckedForm) -> Response:
    try:
        with lab.database.writing() as db:
            studies.discard_draft(db, slug, fields.get("base", ""))
    except (BadInputError, studies.DraftChangedError) as error:
        return refused(lab, visitor, slug, error)
    return go(address(slug))


@router.post("/admin/studies/{slug}/copy")
def copy(lab: CurrentLab, slug: str, _: CheckedForm) -> Response:
    with lab.database.writing() as db:
        made = studies.copy(db, lab, slug)
    return go(address(made))
