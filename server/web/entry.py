"""Coming in: the entry link `/s/{slug}` and the consent form.

A direct link names nobody, so a cookie brings the same browser back to its session. People from a marketplace
are known by their id and get no cookie: the key in the path is all they need, also inside MTurk's frame.
"""

import re
from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request
from starlette.responses import RedirectResponse, Response

from server.domain.errors import NotFoundError
from server.domain.money import shown
from server.domain.study import StudyDefinition
from server.recruitment import mturk, personal
from server.recruitment.recognition import marketplace_of
from server.services import enrol
from server.services.enrol import DeviceReport, Enrolled, Entry, Refused
from server.services.lab import Lab
from server.web import ends, messages
from server.web.dependencies import CurrentLab, Fields
from server.web.pages import ConsentPage
from server.web.rendering import html
from server.web.session_pages import bonus_rule

router = APIRouter()

SLUG = re.compile(r"[a-z0-9-]{1,64}")
PLAIN = re.compile(r"[^\x00-\x1f\x7f]{0,500}")  # a control character in a value is nobody's typing
COOKIE_S = 30 * 86_400
TEXT_CHANGED = "The text of this page was changed while you had it open. Please read it again."
TICK_FIRST = "Please tick the box first: it says that you have read this page and agree."
KEPT_NAMED = (
    "If you say no, we keep only that you did, with the date and a scrambled form of your identifier, "
    "so that you are not asked again."
)
KEPT_NOBODY = "If you say no, nothing about you is kept."
Robot = Annotated[str | None, Header(alias="X-Hatlab-Robot", max_length=500)]


@router.get("/")
def front_door() -> Response:
    """For whoever types the address of the server."""
    return html(messages.front_door())


@router.get("/s/{slug}")
def entry_page(request: Request, lab: CurrentLab, slug: str, robot: Robot = None) -> Response:
    """Where this link leads: to consent, back into a session, or to a message."""
    params = plain(request.query_params)
    if not SLUG.fullmatch(slug):
        return html(messages.unknown_study(), 404)
    with lab.database.reading() as db:
        found = enrol.entry(db, lab, slug, params, robot)
    if found.key is not None:
        with lab.database.writing() as db:
            enrol.come_back(db, lab, found.key, params)
    if found.kind == "consent" and (key := remembered(request, lab, slug, params)):
        return RedirectResponse(f"/p/{key}", 303)
    return page_of_entry(lab, found, slug, params)


@router.post("/s/{slug}/consent")
def give_consent(
    request: Request, lab: CurrentLab, slug: str, fields: Fields, robot: Robot = None
) -> Response:
    """The end of consent: into the session, or nothing is kept."""
    params, agree = plain(fields), fields.get("agree")
    if not SLUG.fullmatch(slug):
        return html(messages.unknown_study(), 404)
    if agree != "no" and (agree != "yes" or params.get("read") != "yes"):
        return unticked(lab, slug, params, robot)
    device = DeviceReport(params.get("device", ""), params.get("browser", ""), params.get("viewport", ""))
    try:
        with lab.database.writing() as db:
            done = enrol.consent(db, lab, slug, params, agree=agree == "yes", device=device, robot=robot)
    except NotFoundError:
        return html(messages.unknown_study(), 404)
    if isinstance(done, Entry):
        return consent_again(lab, done, slug, params, TEXT_CHANGED)
    return decided(request, lab, slug, params, done)


@router.post("/s/{slug}/screened")
def screened(request: Request, lab: CurrentLab, slug: str, fields: Fields, robot: Robot = None) -> Response:
    """The browser says that this device does not fit the study."""
    params = plain(fields)
    if not SLUG.fullmatch(slug):
        return html(messages.unknown_study(), 404)
    try:
        with lab.database.writing() as db:
            done = enrol.screen_out(db, lab, slug, params, robot)
    except NotFoundError:
        return html(messages.unknown_study(), 404)
    if isinstance(done, Entry):
        return page_of_entry(lab, done, slug, params)
    return decided(request, lab, slug, params, done)


def decided(
    request: Request, lab: Lab, slug: str, params: Mapping[str, str], done: Enrolled | Refused
) -> Response:
    """In, or not."""
    if isinstance(done, Enrolled):
        return into_session(request, lab, slug, params, done.key)
    return refused(lab, done, params)


def refused(lab: Lab, done: Refused, params: Mapping[str, str]) -> Response:
    """What is told to who does not take part; what to hand in and the way back where there is one."""
    hosts = mturk.submit_hosts(lab.settings.mturk_extra_host)
    arrival = enrol.recognised(lab, done.study.slug, params)
    page = ends.refused_page(done.study, done.status, arrival, params.get("reason", ""), hosts)
    return html(page, frames=frames(lab, params), forms=hosts if frames(lab, params) else ())


def into_session(request: Request, lab: Lab, slug: str, params: Mapping[str, str], key: str) -> Response:
    response = RedirectResponse(f"/p/{key}", 303)
    if marketplace_of(params) == "direct":
        response.set_cookie(
            cookie_name(slug),
            key,
            max_age=COOKIE_S,
            path=f"/s/{slug}",
            secure=lab.settings.behind_https or request.url.scheme == "https",
            httponly=True,
            samesite="lax",
        )
    return response


def remembered(request: Request, lab: Lab, slug: str, params: Mapping[str, str]) -> str | None:
    """The key of the session that this browser began by the direct link."""
    key = request.cookies.get(cookie_name(slug), "")
    if not key or marketplace_of(params) != "direct":
        return None
    try:
        with lab.database.reading() as db:
            enrol.participant_by_key(db, lab, key)
    except NotFoundError:
        return None
    return key


def unticked(lab: Lab, slug: str, params: Mapping[str, str], robot: str | None) -> Response:
    """The consent page again, with what is missing."""
    with lab.database.reading() as db:
        found = enrol.entry(db, lab, slug, params, robot)
    return consent_again(lab, found, slug, params, TICK_FIRST)


def consent_again(lab: Lab, found: Entry, slug: str, params: Mapping[str, str], why: str) -> Response:
    """Say why consent is asked for once more, if it still is; the visit keeps its name."""
    if found.kind != "consent":
        return page_of_entry(lab, found, slug, params)
    kept = {name: params.get(name, value) for name, value in found.identifiers.items()}
    kept[enrol.TEXT] = found.identifiers[enrol.TEXT]
    return html(consent_page(found, slug, kept, why), 422, frames=frames(lab, params))


def page_of_entry(lab: Lab, found: Entry, slug: str, params: Mapping[str, str]) -> Response:
    if found.key is not None:
        return RedirectResponse(f"/p/{found.key}", 303)
    if found.study is None:
        return html(messages.unknown_study(), 404)
    if found.kind == "consent":
        page = consent_page(found, slug, found.identifiers)
        return html(page, frames=frames(lab, params))
    if found.kind in {"declined", "screened_out"}:
        status: enrol.Refusal = "declined" if found.kind == "declined" else "screened_out"
        return refused(lab, Refused(found.study, status), params)
    code = 403 if found.kind == "not_invited" else 200
    return html(messages.of_entry(found.kind, found.study), code, frames=frames(lab, params))


def consent_page(
    found: Entry, slug: str, identifiers: Mapping[str, str], error: str | None = None
) -> ConsentPage:
    study = found.study
    assert study is not None
    return ConsentPage(
        study_title=study.title,
        welcome=study.texts.welcome,
        paragraphs=study.texts.consent,
        agree_text=study.texts.agree,
        contact=study.contact,
        facts=facts(study),
        identifiers=identifiers,
        action=f"/s/{slug}/consent",
        screened_url=f"/s/{slug}/screened",
        gate=gate(study),
        kept_text=KEPT_NAMED if enrol.VISIT not in identifiers else KEPT_NOBODY,
        language=study.texts.language,
        direction=study.texts.direction,
        error=error,
    )


def gate(study: StudyDefinition) -> dict[str, Any]:
    """What the browser is asked to show before consent."""
    keys = [["up", "right", "down", "left"]] if study.task == "parent_child" else [["brake"], ["go"]]
    return {**study.gate.model_dump(), "keys": keys if study.gate.keyboard else []}


def facts(study: StudyDefinition) -> tuple[tuple[str, str], ...]:
    return (
        ("Time", f"about {study.duration_min} minutes"),
        ("Payment", payment(study)),
        ("You need", "a computer with a keyboard"),
    )


def payment(study: StudyDefinition) -> str:
    if study.pay is None:
        return study.reward_text
    reward, rule = shown(study.pay.reward_minor, study.pay.currency), bonus_rule(study)
    return f"{reward}, and {rule}" if rule else reward


def frames(lab: Lab, params: Mapping[str, str]) -> tuple[str, ...]:
    """Who may embed the page: MTurk its own workers'."""
    return mturk.frame_hosts(lab.settings.mturk_extra_host) if marketplace_of(params) == "mturk" else ()


def plain(values: Mapping[str, str]) -> dict[str, str]:
    """The values that somebody can have typed or a marketplace sent.

    An invitation that is neither stays, but empty: without it, its sender would count as nobody's guest.
    """
    kept = {name: value for name, value in values.items() if PLAIN.fullmatch(value)}
    return kept if personal.PARAMETER not in values else {personal.PARAMETER: "", **kept}


def cookie_name(slug: str) -> str:
    return f"hatlab-{slug}"
