"""The forms of a session: what is asked on a page, under which name it is stored. No right answer is in here.

Names: `quiz:<block>`, `attention:<after round>`, `probe:0`, and `<key>:<block>` of a questionnaire (block 0:
after all blocks).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from server.domain.questionnaire import AttentionCheck, Item, Question, Questionnaire
from server.domain.study import Role, StudyDefinition

FormKind = Literal["quiz", "attention", "questionnaire", "probe"]


@dataclass(frozen=True, slots=True)
class Form:
    """One page of questions; `attempt` counts from 1."""

    kind: FormKind
    name: str
    attempt: int
    tries_left: int
    """Tries after this one."""
    title: str
    lead: str | None
    items: tuple[Item, ...]


def quiz(study: StudyDefinition, role: Role, block: int, attempt: int) -> Form:
    items = tuple(plain(question) for question in study.quiz_of(role))
    left = study.quiz_tries - attempt
    return Form("quiz", f"quiz:{block}", attempt, left, "A few questions about the game", None, items)


def attention(check: AttentionCheck) -> Form:
    return Form(
        "attention", f"attention:{check.after}", 1, 0, "One question in between", None, (plain(check),)
    )


def questionnaire(asked: Questionnaire, block: int) -> Form:
    return Form("questionnaire", f"{asked.key}:{block}", 1, 0, asked.title, asked.lead, asked.items)


def probe(numbers: Sequence[int]) -> Form:
    """Where does each sign point? One mark on the board a sign, by the number that the participant saw."""
    items = tuple(
        Item(key=f"sign_{number}", text=f"Sign {number}", kind="text", required=False)
        for number in sorted(numbers)
    )
    return Form("probe", "probe:0", 1, 0, "What does each sign tell?", None, items)


def plain(question: Question) -> Item:
    """A question without its answer."""
    return Item.model_validate(question.model_dump(include=set(Item.model_fields)))


def right_answers(study: StudyDefinition, name: str, role: Role) -> dict[str, Question]:
    """The questions of a form that have a right answer, by key."""
    kind, _, number = name.partition(":")
    if kind == "quiz":
        return {question.key: question for question in study.quiz_of(role)}
    if kind == "attention":
        return {check.key: check for check in study.attention if str(check.after) == number}
    return {}


def items_of(study: StudyDefinition, name: str) -> dict[str, Item]:
    """The questions of a form by key, of every role; the marks of a probe are no questions."""
    kind, _, _ = name.partition(":")
    asked: tuple[Item, ...] = ()
    if kind == "quiz":
        asked = study.quiz
    elif kind == "attention":
        asked = study.attention
    else:
        asked = next((each.items for each in study.questionnaires if each.key == kind), ())
    return {item.key: item for item in asked}


def block_of(study: StudyDefinition, name: str) -> int:
    """The block in which a form comes; 0: after all blocks."""
    kind, _, number = name.partition(":")
    return (int(number) - 1) // study.trials_per_block + 1 if kind == "attention" else int(number)


def check_due(study: StudyDefinition, rounds_over: int, answered: Sequence[str]) -> AttentionCheck | None:
    """The attention check that comes next, if one is due."""
    due = sorted((c for c in study.attention if c.after <= rounds_over), key=lambda check: check.after)
    return next((check for check in due if f"attention:{check.after}" not in answered), None)
