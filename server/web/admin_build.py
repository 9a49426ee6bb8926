"""Admin: the page on which a study is made and changed."""

from collections.abc import Mapping
from typing import Any, cast

from fastapi import APIRouter, Depends
from fastapi.responses import RedirectResponse
from starlette.responses import Response

from server.domain.errors import NotFoundError
from server.domain.study import Offer, Task
from server.services import studies
from server.services.lab import Lab
from server.services.studies import TASKS, Study
from server.storage.database import DbSession
from server.web import admin_forms
from server.web.admin_access import CheckedForm, CurrentVisitor, Visitor, signed_in
from server.web.admin_frame import entry_links, frame, head, minute
from server.web.admin_pages import BuildPage, BundleChoice, Form, LaunchedVersion, Step
from server.web.dependencies import CurrentLab
from server.web.rendering import html

router = APIRouter(dependencies=[Depends(signed_in)])
STALE = (
    "Somebody else saved this study while you had it open. Nothing of yours is stored yet: save again to "
    "replace what they saved, or open the study anew to see it."
)


@router.get("/admin/studies/{slug}")
def build_page(lab: CurrentLab, visitor: CurrentVisitor, slug: str, saved: str = "") -> Response:
    with lab.database.reading() as db:
        study = studies.find(db, slug)
        _, errors = studies.judged(study.values, lab)
        return page(db, lab, visitor, study, study.values, errors, saved=bool(saved))


@router.post("/admin/studies/{slug}")
def build(lab: CurrentLab, visitor: CurrentVisitor, slug: str, fields: CheckedForm) -> Response:
    action = fields.get("action", "save")
    address = f"/admin/studies/{slug}"
    with lab.database.writing() as db:
        before = studies.find(db, slug)
        whole = {**before.values, **admin_forms.typed(fields, before.values["task"])}
        values = admin_forms.with_arms_changed(whole, action)
        result = studies.save_draft(db, lab, slug, values, fields.get("base", ""))
    with lab.database.reading() as db:
        study = studies.find(db, slug)
        if result.stale:
            return page(db, lab, visitor, study, values, result.errors, notice=STALE, status=409)
        if "arm" in action:
            return RedirectResponse(f"{address}#arms", 303)
        if result.errors:
            return page(db, lab, visitor, study, values, result.errors, saved=True, status=422)
    goes_on = action == "launch" and study.has_draft
    return RedirectResponse(f"{address}/launch" if goes_on else f"{address}?saved=1", 303)


def page(
    db: DbSession,
    lab: Lab,
    visitor: Visitor,
    study: Study,
    values: Mapping[str, Any],
    errors: Mapping[str, str],
    *,
    saved: bool = False,
    notice: str | None = None,
    status: int = 200,
) -> Response:
    """The form with what was typed, and each message at its field."""
    task = cast("Task", study.values["task"])
    built = BuildPage(
        frame=frame(db, lab, visitor),
        head=head(study, "build"),
        task=f"{TASKS[task]}, {world(str(values['environment']))}",
        form=Form(admin_forms.shown(values, task), errors),
        arms=tuple(range(len(values.get("arms", ())))),
        bundles=choices(lab.offers, str(values["environment"])),
        communications=admin_forms.communications(task),
        roles=("parent", "child") if task == "parent_child" else ("driver",),
        mistakes=admin_forms.mistakes(errors),
        wrong_sections=admin_forms.wrong_sections(errors),
        base=study.base,
        steps=steps(values, task),
        places=places(values),
        links=entry_links(lab, study),
        versions=launched(db, study),
        saved=saved,
        notice=notice,
    )
    return html(built, status)


def launched(db: DbSession, study: Study) -> tuple[LaunchedVersion, ...]:
    """The newest first."""
    return tuple(
        LaunchedVersion(
            each.number,
            minute(each.launched_utc),
            each.sha256,
            f"/admin/studies/{study.row.slug}/versions/{each.number}.json",
        )
        for each in reversed(studies.versions(db, study))
    )


@router.get("/admin/studies/{slug}/versions/{number}.json")
def version_as_launched(lab: CurrentLab, slug: str, number: int) -> Response:
    """The very bytes that were launched: their sha256 is the version's."""
    with lab.database.reading() as db:
        found = {each.number: each for each in studies.versions(db, studies.find(db, slug))}
    if number not in found:
        raise NotFoundError(f"there is no version {number} of {slug!r}")
    headers = {"cache-control": "no-store"}
    return Response(found[number].definition, media_type="application/json", headers=headers)


def world(environment: str) -> str:
    return {
        "parent_child": "board of 9 by 9",
        "traffic_junction/easy": "crossing of 7 by 7",
        "traffic_junction/medium": "junction of 14 by 14",
        "traffic_junction/hard": "four junctions of 18 by 18",
    }.get(environment, environment)


def choices(offers: Mapping[str, Offer], environment: str) -> tuple[BundleChoice, ...]:
    """The loaded agents that were trained in the study's world."""
    fitting = (offer for _, offer in sorted(offers.items()) if offer.environment == environment)
    return tuple(
        BundleChoice(offer.name, offer.channel, f"{offer.budget:g}", offer.tokens) for offer in fitting
    )


def steps(values: Mapping[str, Any], task: Task) -> tuple[Step, ...]:
    """What a participant goes through."""
    trials, practice = (str(values.get(name, "–") or "–") for name in ("trials_per_block", "practice_rounds"))
    way = [Step("Entry and consent", "")]
    for role, name in (
        (("parent", "as parent"), ("child", "as child")) if task == "parent_child" else (("", ""),)
    ):
        way += [
            Step(f"How to play {name}".strip(), ""),
            Step(f"Practice {name}".strip(), practice),
            *asked("Quiz", questions(values, "quiz", role)),
            Step(f"Rounds {name}".strip(), trials),
            *asked("Questions about the rounds", items(values, "block")),
        ]
    way += asked("Attention checks in between", len(listed(values, "attention")))
    way += [Step("What the signs mean", "")] if values.get("token_probe") in {True, "true"} else []
    return (*way, *asked("Last questions", items(values, "end")), Step("Completion code", ""))


def asked(name: str, number: int) -> list[Step]:
    """A step with so many questions; none where nothing is asked."""
    return [Step(name, str(number))] if number else []


def listed(values: Mapping[str, Any], name: str) -> list[Mapping[str, Any]]:
    """The parts of a list that was typed, as far as they can be read."""
    given = values.get(name, ())
    return [part for part in given if isinstance(part, Mapping)] if isinstance(given, list | tuple) else []


def questions(values: Mapping[str, Any], name: str, role: str) -> int:
    return sum(not role or part.get("role") in {None, role} for part in listed(values, name))


def items(values: Mapping[str, Any], when: str) -> int:
    """How many items all questionnaires of one place have."""
    parts = [part for part in listed(values, "questionnaires") if part.get("when", "end") == when]
    return sum(len(listed(part, "items")) for part in parts)


def places(values: Mapping[str, Any]) -> str:
    """The sum over the arms; a dash while one of them is no number."""
    typed = [str(arm.get("places", "")) for arm in values.get("arms", ())]
    return str(sum(int(each) for each in typed)) if all(each.isdecimal() for each in typed) else "–"
