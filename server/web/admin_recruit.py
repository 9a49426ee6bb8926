"""Admin: recruiting at a marketplace, and the reconciler: every mismatch, done only when confirmed."""

from collections.abc import Callable, Mapping
from typing import Annotated

from fastapi import APIRouter, Depends
from fastapi import Path as PathParameter
from starlette.responses import Response

from server.domain.errors import BadInputError, HatlabError, NotFoundError
from server.domain.money import shown
from server.domain.reconciliation import Mismatch
from server.services import reconcile, recruit, studies
from server.services.lab import Lab
from server.services.reconcile import Found, Outcome
from server.services.recruiters import NAMES, is_connected
from server.storage import postings
from server.storage.database import DbSession
from server.storage.postings import PaymentRow, PostingRow
from server.web.admin_access import CheckedForm, CurrentVisitor, Visitor, signed_in
from server.web.admin_frame import frame, head, minute
from server.web.admin_launch import address, ask, go, refused
from server.web.admin_pages import (
    Choice,
    LedgerLine,
    MismatchLine,
    PostingBox,
    RecruitmentPage,
)
from server.web.dependencies import CurrentLab
from server.web.rendering import html

router = APIRouter(dependencies=[Depends(signed_in)])
DO = "do."
LEDGER_MAX = 100
ACTIONS = {
    "approve": "Approve and pay",
    "bonus": "Pay the bonus",
    "partial": "Pay the partial reward",
    "screen_out": "Screen out there",
    "ask_return": "Ask for a return",
    "follow": "Follow them here",
    "look": "Look into it",
}
LINK = "/admin/studies/{slug}/recruitment"
MOST = 2**31 - 1  # a database's integer


def posting_of_study(
    lab: CurrentLab, slug: str, posting: Annotated[int, PathParameter(ge=1, le=MOST)]
) -> int:
    """The posting that an address names, if the study of the same address has it.

    Raises:
        NotFoundError: it has none of this number.
    """
    with lab.database.reading() as db:
        if recruit.place_of(db, lab, posting).slug != slug:
            raise NotFoundError("this study has no such posting")
    return posting


PostingId = Annotated[int, Depends(posting_of_study)]


@router.get(LINK)
def recruitment_page(lab: CurrentLab, visitor: CurrentVisitor, slug: str) -> Response:
    return shown_page(lab, visitor, slug)


def shown_page(
    lab: Lab,
    visitor: Visitor,
    slug: str,
    outcomes: tuple[Outcome, ...] = (),
    values: Mapping[str, str] | None = None,
    error: str = "",
    status: int = 200,
) -> Response:
    """The page of a study's recruitment, with what came of the last confirmation."""
    with lab.database.reading() as db:
        study = studies.find(db, slug)
        boxes = tuple(box(db, lab, row) for row in postings.of_study(db, study.row.id))
        pay = study.definition.pay if study.definition else None
        page = RecruitmentPage(
            frame=frame(db, lab, visitor),
            head=head(study, "recruitment"),
            choices=choices(lab),
            postings=boxes,
            can_post=pay is not None and study.version is not None,
            places=study.definition.places if study.definition else 0,
            values=dict(values or {}),
            error=error,
            outcomes=tuple((each.done, each.key, each.says) for each in outcomes),
            caps=(shown(pay.cap_participant_minor, pay.currency), shown(pay.cap_study_minor, pay.currency))
            if pay
            else ("", ""),
            webhook_url=f"{lab.settings.public_url}/hooks/prolific",
        )
    return html(page, status)


def choices(lab: Lab) -> tuple[Choice, ...]:
    return tuple(Choice(name, label, is_connected(lab.settings, name)) for name, label in NAMES.items())


def box(db: DbSession, lab: Lab, row: PostingRow) -> PostingBox:
    """One posting with everything about it."""
    found = reconcile.look(db, lab, row.id)
    currency = found.place.study.pay.currency if found.place.study.pay else "GBP"
    states: dict[str, int] = {}
    for each in postings.submissions(db, row.id):
        states[each.state] = states.get(each.state, 0) + 1
    return PostingBox(
        id=row.id,
        marketplace=NAMES.get(row.marketplace, row.marketplace),
        external_id=row.external_id,
        state=row.state.replace("_", " "),
        mode=found.place.mode,
        places=row.places,
        polled=minute(row.polled_utc) if row.polled_utc else "never",
        states=tuple((name.replace("_", " "), number) for name, number in sorted(states.items())),
        mismatches=tuple(line(each, currency) for each in found.mismatches),
        to_do=len(reconcile.confirmable(found)),
        ledger=tuple(ledger_line(each) for each in found.ledger[:LEDGER_MAX]),
        ledger_more=max(0, len(found.ledger) - LEDGER_MAX),
        spent=shown(found.spent_minor, currency),
    )


def line(each: Mismatch, currency: str) -> MismatchLine:
    return MismatchLine(
        key=each.key,
        participant=each.participant_id or "–",
        submission=each.submission_id,
        ours=each.ours.replace("_", " "),
        theirs=each.theirs.replace("_", " "),
        says=each.says,
        action=ACTIONS[each.action],
        amount=shown(each.amount_minor, currency) if each.amount_minor else "",
        can_do=each.action != "look",
    )


def ledger_line(row: PaymentRow) -> LedgerLine:
    return LedgerLine(
        when=minute(row.done_utc or row.asked_utc),
        participant=row.participant_id or "–",
        submission=row.submission_id,
        what=ACTIONS.get(row.kind, row.kind),
        amount=shown(row.amount_minor, row.currency) if row.amount_minor else "",
        state=row.state,
        by=row.asked_by,
        detail=row.detail,
    )


@router.post(LINK)
def create(lab: CurrentLab, visitor: CurrentVisitor, slug: str, fields: CheckedForm) -> Response:
    """Make a draft at a marketplace; nobody is recruited by that."""
    places = fields.get("places", "")
    number = int(places) if places.isascii() and places.isdecimal() and len(places) < 7 else 0
    marketplace = fields.get("marketplace", "")
    try:
        if marketplace not in NAMES:
            raise BadInputError("Choose a marketplace.")
        recruit.create(lab, slug, marketplace, number, fields.get("description", "").strip()[:2_000])
    except HatlabError as error:
        return shown_page(lab, visitor, slug, values=fields, error=error.detail, status=error.status)
    return go(address(slug, "recruitment"))


@router.get(LINK + "/{posting}/publish")
def ask_to_publish(lab: CurrentLab, visitor: CurrentVisitor, slug: str, posting: PostingId) -> Response:
    with lab.database.reading() as db:
        place, study = recruit.place_of(db, lab, posting), studies.find(db, slug)
        pay = place.study.pay
        each = shown(pay.reward_minor, pay.currency) if pay else "nothing"
        consequences = (
            f"{place.row.places} places are offered at {NAMES[place.row.marketplace]}, each for {each}.",
            "People see it at once, and begin. It can be paused at any time.",
            f"The study is in {study.row.mode} mode: who enters counts as {study.row.mode} data.",
        )
        return ask(
            db,
            lab,
            visitor,
            study,
            f"recruitment/{posting}/publish",
            f"Recruit at {NAMES[place.row.marketplace]}?",
            consequences,
            "Publish",
            fields={},
        )


@router.post(LINK + "/{posting}/publish")
def publish(
    lab: CurrentLab, visitor: CurrentVisitor, slug: str, posting: PostingId, fields: CheckedForm
) -> Response:
    return steered(lab, visitor, slug, lambda: recruit.publish(lab, posting), fields)


@router.post(LINK + "/{posting}/pause")
def pause(
    lab: CurrentLab, visitor: CurrentVisitor, slug: str, posting: PostingId, fields: CheckedForm
) -> Response:
    return steered(lab, visitor, slug, lambda: recruit.pause(lab, posting), fields)


@router.post(LINK + "/{posting}/places")
def set_places(
    lab: CurrentLab, visitor: CurrentVisitor, slug: str, posting: PostingId, fields: CheckedForm
) -> Response:
    text = fields.get("places", "")
    number = int(text) if text.isascii() and text.isdecimal() and len(text) < 7 else 0
    return steered(lab, visitor, slug, lambda: recruit.set_places(lab, posting, number), fields)


@router.post(LINK + "/{posting}/poll")
def poll(
    lab: CurrentLab, visitor: CurrentVisitor, slug: str, posting: PostingId, fields: CheckedForm
) -> Response:
    """Ask the marketplace how everything stands."""
    return steered(lab, visitor, slug, lambda: recruit.poll(lab, posting), fields)


def steered(
    lab: Lab, visitor: Visitor, slug: str, do: Callable[[], object], _: Mapping[str, str]
) -> Response:
    try:
        do()
    except HatlabError as error:
        return refused(lab, visitor, slug, error)
    return go(address(slug, "recruitment"))


@router.post(LINK + "/{posting}/review")
def review(
    lab: CurrentLab, visitor: CurrentVisitor, slug: str, posting: PostingId, fields: CheckedForm
) -> Response:
    """What was chosen, with what it costs; nothing has happened yet."""
    with lab.database.reading() as db:
        study, found = studies.find(db, slug), reconcile.look(db, lab, posting)
        chosen = [each for each in found.mismatches if each.key in chosen_keys(fields)]
        if not chosen:
            return go(address(slug, "recruitment"))
        return ask(
            db,
            lab,
            visitor,
            study,
            f"recruitment/{posting}/confirm",
            "Do this at the marketplace?",
            tuple(costs(found, chosen)),
            "Yes, do it" if len(chosen) == 1 else f"Yes, do all {len(chosen)}",
            fields={f"{DO}{each.key}": "1" for each in chosen},
        )


def costs(found: Found, chosen: list[Mismatch]) -> list[str]:
    """The chosen things by kind, and the money."""
    currency = found.place.study.pay.currency if found.place.study.pay else "GBP"
    lines = []
    for action, words in ACTIONS.items():
        mine = [each for each in chosen if each.action == action]
        if mine:
            money = sum(each.amount_minor for each in mine)
            lines.append(f"{words}: {len(mine)}{f', {shown(money, currency)} in all' if money else ''}")
    total = sum(each.amount_minor for each in chosen)
    lines.append(f"This costs {shown(total, currency)} (fees of the marketplace come on top).")
    lines.append("Nobody is rejected. What was paid cannot be taken back.")
    return lines


def chosen_keys(fields: Mapping[str, str]) -> set[str]:
    return {name.removeprefix(DO) for name in fields if name.startswith(DO)}


@router.post(LINK + "/{posting}/confirm")
def confirm(
    lab: CurrentLab, visitor: CurrentVisitor, slug: str, posting: PostingId, fields: CheckedForm
) -> Response:
    """Do what was confirmed; pressed twice it happens once."""
    try:
        outcomes = reconcile.confirm(lab, posting, sorted(chosen_keys(fields)), visitor.username)
    except HatlabError as error:
        return refused(lab, visitor, slug, error)
    return shown_page(lab, visitor, slug, tuple(outcomes))
