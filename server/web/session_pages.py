"""The contexts of the pages that somebody in a study goes through."""

from collections.abc import Mapping
from dataclasses import replace

from server.domain.forms import Form
from server.domain.money import bonus_minor, shown
from server.domain.participation import State as Standing
from server.domain.questionnaire import Item
from server.domain.study import StudyDefinition
from server.services.pages import Page as State
from server.services.recruiters import promised_minor
from server.web.pages import Bar, FormPage, InstructionsPage, PlayPage, Question, Rules, WithdrawPage

TRY_AGAIN = "Not everything was right. Please read once more below how to play, and answer again."
LOOK_AGAIN = "Please look at the marked questions."


def bar(state: State, key: str) -> Bar:
    progress, pay = state.progress, state.study.pay
    return Bar(
        rounds_over=progress.rounds_over,
        rounds=progress.rounds,
        minutes=progress.minutes,
        pay=shown(pay.reward_minor, pay.currency) if pay else "",
        bonus=shown(progress.bonus_minor, pay.currency) if pay and pay.bonus_success_minor else "",
        bonus_rule=bonus_rule(state.study),
        contact=state.study.contact,
        withdraw_url=f"/p/{key}/withdraw",
    )


def bonus_rule(study: StudyDefinition) -> str:
    """The rule in words; empty without a bonus."""
    pay = study.pay
    if pay is None or not pay.bonus_success_minor:
        return ""
    won = "child found" if study.task == "parent_child" else "safe arrival"
    each, most = (shown(minor, pay.currency) for minor in (pay.bonus_success_minor, pay.bonus_max_minor))
    return f"{each} for each {won}, at most {most}"


def bonuses(study: StudyDefinition) -> list[str]:
    """What 0, 1, 2 … rounds won are worth, in words; empty without a bonus: the bar counts on."""
    pay = study.pay
    if pay is None or not pay.bonus_success_minor:
        return []
    return [shown(bonus_minor(pay, won), pay.currency) for won in range(study.main_rounds + 1)]


def instructions_page(state: State, key: str) -> InstructionsPage:
    study = state.study
    return InstructionsPage(
        title=study.title,
        task=study.task,
        role=state.role,
        block=state.block,
        blocks=state.blocks,
        rounds=study.trials_per_block,
        practice_rounds=study.practice_rounds,
        limit=study.step_limit,
        child_sees_parent=study.child_sees_parent,
        rules=rules(state),
        page=state.name,
        next_url=f"/p/{key}/next",
        quiz=bool(study.quiz_of(state.role)),
        bar=bar(state, key),
        events_url=f"/p/{key}/events",
        language=study.texts.language,
        direction=study.texts.direction,
    )


def play_page(state: State, key: str) -> PlayPage:
    study = state.study
    addresses = {"round_url": f"/p/{key}/round", "step_url": f"/p/{key}/step", "page_url": f"/p/{key}"}
    data = {
        **addresses,
        "events_url": f"/p/{key}/events",
        "page": state.name,
        "won": state.progress.won,
        "bonuses": bonuses(study),
        "task": study.task,
        "role": state.role,
        "block": state.block,
        "blocks": state.blocks,
        "rounds": study.trials_per_block,
        "practice_rounds": study.practice_rounds,
        "limit": study.step_limit,
    }
    return PlayPage(
        title=study.title,
        task=study.task,
        role=state.role,
        block=state.block,
        blocks=state.blocks,
        rounds=study.trials_per_block,
        limit=study.step_limit,
        data=data,
        bar=bar(state, key),
        language=study.texts.language,
        direction=study.texts.direction,
        **addresses,
    )


def form_page(state: State, key: str, given: Mapping[str, str], errors: Mapping[str, str]) -> FormPage:
    """The form that is due, with what was answered so far and what was wrong with it."""
    form, study = state.form, state.study
    assert form is not None
    return FormPage(
        title=study.title,
        kind=form.kind,
        heading=form.title,
        lead=form.lead or "",
        form=form.name,
        attempt=form.attempt,
        tries_left=form.tries_left,
        items=tuple(question(form, item, given, errors) for item in form.items),
        again=TRY_AGAIN if form.attempt > 1 else "",
        rules=replace(rules(state), level=2) if form.attempt > 1 else None,
        error=LOOK_AGAIN if errors else "",
        answers_url=f"/p/{key}/answers",
        data={"events_url": f"/p/{key}/events", "page": state.name, **(state.signs or {})},
        bar=bar(state, key),
        language=study.texts.language,
        direction=study.texts.direction,
    )


def rules(state: State) -> Rules:
    study = state.study
    return Rules(state.role, study.step_limit, study.child_sees_parent, study.texts.instructions)


def question(form: Form, item: Item, given: Mapping[str, str], errors: Mapping[str, str]) -> Question:
    if item.kind == "choice":
        options = tuple(zip(item.values, item.options, strict=True))
    else:
        options = tuple((value, "") for value in item.values)
    return Question(
        key=item.key,
        text=item.text,
        kind="cell" if form.kind == "probe" else item.kind,
        options=options,
        low=item.low or "",
        high=item.high or "",
        minimum=f"{item.minimum:g}",
        maximum=f"{item.maximum:g}",
        required=item.required,
        value=given.get(item.key, ""),
        error=errors.get(item.key, ""),
    )


def withdraw_page(state: State, key: str) -> WithdrawPage:
    pay, texts = state.study.pay, state.study.texts
    code = state.study.codes.withdrawn
    part = promised_minor(pay, state.marketplace, Standing.WITHDRAWN, code) if pay else 0
    return WithdrawPage(
        title=state.study.title,
        partial=shown(part, pay.currency) if pay and part else "",
        action=f"/p/{key}/withdraw",
        back_url=f"/p/{key}",
        language=texts.language,
        direction=texts.direction,
    )
