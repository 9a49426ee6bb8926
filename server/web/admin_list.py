"""Admin: the list of studies, and making a new one."""

from fastapi import APIRouter, Depends
from fastapi.responses import RedirectResponse
from starlette.responses import Response

from server.domain.errors import DefinitionError, NotFoundError
from server.services import monitor, studies
from server.services.lab import Lab
from server.services.monitor import Progress
from server.services.studies import TASKS, Study
from server.storage.database import DbSession
from server.web.admin_access import HOME, CheckedForm, CurrentVisitor, Visitor, signed_in
from server.web.admin_frame import frame
from server.web.admin_pages import Filter, Form, NewStudyPage, StudiesPage, StudyLine
from server.web.dependencies import CurrentLab
from server.web.rendering import html

router = APIRouter(dependencies=[Depends(signed_in)])
SHOWN = ("open", "paused", "draft", "closed")


@router.get(HOME)
def list_studies(lab: CurrentLab, visitor: CurrentVisitor, show: str = "all") -> Response:
    with lab.database.reading() as db:
        every = [(study, monitor.counts(db, lab, study)) for study in studies.every(db)]
        surround = frame(db, lab, visitor)
    chosen = [pair for pair in every if show in {"all", pair[0].row.status}]
    newest_first = sorted(chosen, key=lambda pair: (pair[0].row.status == "closed", -pair[0].row.id))
    live = [(study, progress) for study, progress in every if study.row.mode == "live" and study.version]
    page = StudiesPage(
        frame=surround,
        lines=tuple(study_line(lab, study, progress) for study, progress in newest_first),
        filters=filters([study for study, _ in every], show),
        active=sum(
            people(progress, "live").active + people(progress, "test").active for _, progress in every
        ),
        finished_live=sum(people(progress, "live").finished for _, progress in every),
        places_live=sum(progress.modes["live"].places for _, progress in live),
        finished_test=sum(people(progress, "test").finished for _, progress in every),
        bundle_errors=len(lab.bundle_errors),
    )
    return html(page)


def people(progress: Progress, mode: str) -> monitor.Headcount:
    return progress.modes[mode].people


def filters(every: list[Study], show: str) -> tuple[Filter, ...]:
    """All, and the states that there are."""
    found = [Filter(f"All {len(every)}", HOME, show not in SHOWN)]
    for status in SHOWN:
        number = sum(study.row.status == status for study in every)
        if number or show == status:
            found.append(Filter(f"{status.capitalize()} {number}", f"{HOME}?show={status}", show == status))
    return tuple(found)


def study_line(lab: Lab, study: Study, progress: Progress) -> StudyLine:
    """One row; the counts are those of the mode that the study collects now."""
    row, counts = study.row, people(progress, study.row.mode)
    last = progress.modes[row.mode].last_seen_utc
    return StudyLine(
        slug=row.slug,
        title=row.title,
        task=TASKS[study.values["task"]],
        status=row.status,
        mode=row.mode,
        version=f"version {study.version.number}" if study.version else "not launched",
        arms=len(study.definition.arms if study.definition else study.values.get("arms", ())),
        places=study.definition.places if study.definition else 0,
        finished=counts.finished,
        active=counts.active,
        last_activity=monitor.ago(last, lab.now()),
        last_activity_utc=last,
    )


@router.get("/admin/studies/new")
def new_study_page(lab: CurrentLab, visitor: CurrentVisitor) -> Response:
    first = studies.templates()[0]
    with lab.database.reading() as db:
        return new_study_form(db, lab, visitor, Form({"source": f"template:{first.name}"}))


@router.post("/admin/studies/new")
def new_study(lab: CurrentLab, visitor: CurrentVisitor, fields: CheckedForm) -> Response:
    source, title, slug = (fields.get(name, "") for name in ("source", "title", "slug"))
    try:
        with lab.database.writing() as db:
            made = make(db, lab, source, title, slug)
    except DefinitionError as error:
        with lab.database.reading() as db:
            return new_study_form(db, lab, visitor, Form(fields, error.fields), 422)
    return RedirectResponse(f"/admin/studies/{made}", 303)


def make(db: DbSession, lab: Lab, source: str, title: str, slug: str) -> str:
    """Add the draft; `source` is `template:<name>` or `copy:<slug>`."""
    kind, _, name = source.partition(":")
    try:
        if kind == "template":
            return studies.create_from_template(db, lab, name, title, slug)
        if kind == "copy":
            return studies.create(db, lab, studies.find(db, name).values, title, slug)
    except NotFoundError:
        pass
    raise DefinitionError({"source": "Choose what to start from."})


def new_study_form(db: DbSession, lab: Lab, visitor: Visitor, form: Form, status: int = 200) -> Response:
    known = tuple((study.row.slug, study.row.title) for study in studies.every(db))
    return html(NewStudyPage(frame(db, lab, visitor), studies.templates(), known, form), status)
