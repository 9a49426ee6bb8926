"""People on the whole way through a study: forms, rounds, and every end."""

from collections.abc import Callable, Mapping
from typing import Any

from server.domain import study
from server.domain.plan import page_kind
from server.services import answer, enrol, pages
from server.services.answer import UNTIMED, ItemTiming
from server.services.lab import Lab
from server.services.pages import Page
from tests.fakes import definition
from tests.server.services.steps import Chooser, come_in, first, go_on, launch, play_block

Answers = Mapping[str, str]
TIMED = ItemTiming(first_ms=812.25, last_ms=1_604.5, changes=2)


def page(lab: Lab, key: str) -> Page:
    with lab.database.reading() as db:
        return pages.page_of(db, lab, enrol.participant_by_key(db, lab, key))


def right(shown: Page) -> dict[str, str]:
    """Right answers to the form that is due; where none is right, one that is accepted."""
    form = shown.form
    assert form is not None
    known = study.answer_key(shown.study)
    kind = form.name.partition(":")[0]
    if form.kind == "probe":
        return {item.key: "4,4" for item in form.items}
    return {item.key: known.get(f"{kind}.{item.key}") or item.values[0] for item in form.items}


def wrong(shown: Page) -> dict[str, str]:
    """The right answers but for the first question."""
    assert shown.form is not None
    item = shown.form.items[0]
    answers = right(shown)
    return answers | {item.key: next(value for value in item.values if value != answers[item.key])}


def hand_in(
    lab: Lab,
    key: str,
    given: Answers,
    *,
    name: str | None = None,
    attempt: int | None = None,
    timing: ItemTiming = UNTIMED,
) -> None:
    """Hand in the form that is due, or the one that a tab still shows."""
    form = page(lab, key).form
    due_name, due_attempt = (form.name, form.attempt) if form else ("", 0)
    with lab.database.writing() as db:
        who = enrol.participant_by_key(db, lab, key)
        timings = dict.fromkeys(given, timing)
        answer.hand_in(db, lab, who, name or due_name, attempt or due_attempt, given, timings)


def proceed(lab: Lab, key: str, answers: Callable[[Page], Answers], choose: Chooser = first) -> None:
    """Do what the present page asks for."""
    shown = page(lab, key)
    if shown.kind == "form":
        hand_in(lab, key, answers(shown), timing=TIMED)
    elif shown.kind == "play":
        play_block(lab, key, choose)
    else:
        go_on(lab, key)


def walk_to(
    lab: Lab,
    key: str,
    reached: Callable[[Page], Any],
    answers: Callable[[Page], Answers] = right,
    choose: Chooser = first,
) -> Page:
    """Go on until a page is `reached`; that page."""
    for _ in range(60):
        shown = page(lab, key)
        if reached(shown):
            return shown
        assert shown.kind != "end", f"the way ended at {shown.state}"
        proceed(lab, key, answers, choose)
    raise AssertionError(f"still on {page(lab, key).name}")


def at_end(shown: Page) -> bool:
    return shown.kind == "end"


def on(kind: str) -> Callable[[Page], bool]:
    """Whether a page of this kind is shown, with no form in the way."""
    return lambda shown: shown.form is None and page_kind(shown.name)[0] == kind


def asked(kind: str) -> Callable[[Page], bool]:
    """Whether a form of this kind is due."""
    return lambda shown: shown.form is not None and shown.form.kind == kind


def careless(shown: Page) -> Answers:
    """Fail every attention check; else answer right."""
    return wrong(shown) if shown.form is not None and shown.form.kind == "attention" else right(shown)


def entered(lab: Lab, slug: str, name: str = "ada", **changes: Any) -> str:
    """Somebody in a newly launched whole study, on its first page; the key of the session."""
    launch(lab, definition(slug, whole=True, **{"trials_per_block": 2, "practice_rounds": 1} | changes))
    return come_in(lab, slug, name)
