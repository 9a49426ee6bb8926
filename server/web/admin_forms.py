"""The form of a study: its fields as text, what was typed as values, and how each field is called."""

import re
from collections.abc import Mapping
from itertools import count
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from server.domain.study import COMMUNICATIONS, Codes, Gate, Pay, StudyDefinition, Task
from server.services import question_text
from server.services.question_text import SHAPES
from server.web.admin_pages import Mistake

SHARED = (
    "title",
    "trials_per_block",
    "practice_rounds",
    "step_limit",
    "situation_seed",
    "contact",
    "duration_min",
    "reward_text",
    "lease_min",
    "completion_code",
    "completion_url",
    "quiz_tries",
    "attention_failures",
)
OF_TASK: dict[Task, tuple[str, ...]] = {
    "parent_child": ("panel_bundle", "child_sees_parent", "token_probe"),
    "traffic_junction": ("arrival",),
}
TEXTS = (
    "welcome",
    "consent",
    "consent_version",
    "agree",
    "instructions",
    "declined",
    "complete",
    "language",
    "direction",
)
GROUPS: dict[str, type[BaseModel]] = {"gate": Gate, "codes": Codes, "pay": Pay}
"""Parts of a study that are fields of their own, like `pay.reward_minor`."""
CURRENCY = "currency"
"""Always chosen: pay of which nothing else was typed is no pay."""
PARAGRAPHS = frozenset({"consent", "instructions"})
ARM = ("name", "communication", "bundle", "budget", "overlay", "places")
TICKS = frozenset({"child_sees_parent", "overlay", "token_probe", "keyboard"})
DECIMALS = frozenset({"arrival", "budget", "refresh_min_hz"})
ARM_FIELD = re.compile(r"arms\.(\d{1,2})\.(\w+)")
LABELS = {
    "title": "Title",
    "panel_bundle": "Agent of the token positions",
    "arms": "Arms",
    "trials_per_block": "Trials in a block",
    "practice_rounds": "Practice rounds",
    "step_limit": "Steps, at most",
    "arrival": "Chance of a new car",
    "situation_seed": "Seed of the situations",
    "contact": "Contact",
    "duration_min": "Duration",
    "reward_text": "Reward",
    "lease_min": "Place is held",
    "completion_code": "Completion code",
    "completion_url": "Completion link",
    "texts.welcome": "Welcome",
    "texts.consent": "Consent",
    "texts.consent_version": "Version of the consent text",
    "texts.agree": "The sentence that people agree to",
    "texts.instructions": "Above the instructions",
    "texts.declined": "After declining",
    "texts.complete": "After the last round",
    "texts.language": "Language",
    "texts.direction": "Direction of writing",
    "quiz": "Quiz",
    "quiz_tries": "Tries of the quiz",
    "attention": "Attention checks",
    "attention_failures": "Failed checks that exclude",
    "questionnaires": "Questionnaires",
    "token_probe": "Marks for the signs",
    "gate.width_min": "Width of the window",
    "gate.height_min": "Height of the window",
    "gate.refresh_min_hz": "Pictures a second",
    "gate.keyboard": "Keyboard",
    "codes.screened_out": "Code when screened out",
    "codes.failed": "Code after failed checks",
    "codes.withdrawn": "Code after withdrawing",
    "pay": "Pay",
    "pay.currency": "Currency",
    "pay.reward_minor": "Reward to the end",
    "pay.partial_minor": "After withdrawing",
    "pay.screen_out_minor": "When screened out",
    "pay.bonus_success_minor": "Bonus for each success",
    "pay.bonus_max_minor": "Largest bonus",
    "pay.cap_participant_minor": "Most for one person",
    "pay.cap_study_minor": "Most for the study",
}
ARM_LABELS = {"bundle": "Agent", "communication": "Communication"}
SECTIONS = {
    "about": ("title", "texts.welcome"),
    "arms": ("arms", "panel_bundle"),
    "trials": (
        "trials_per_block",
        "practice_rounds",
        "step_limit",
        "arrival",
        "situation_seed",
        "child_sees_parent",
    ),
    "questions": (
        "quiz",
        "quiz_tries",
        "attention",
        "attention_failures",
        "questionnaires",
        "token_probe",
    ),
    "texts": ("texts", "contact"),
    "recruitment": (
        "duration_min",
        "reward_text",
        "lease_min",
        "gate",
        "completion_code",
        "completion_url",
        "codes",
    ),
    "pay": ("pay",),
}
TEXT_DEFAULTS = {"instructions": (), "language": "en", "direction": "ltr"}
COMMUNICATION_LABELS = {
    "prototype": "Prototype",
    "one-hot": "One-hot",
    "shuffled": "Prototype, shuffled places",
}


def shown(values: Mapping[str, Any], task: Task) -> dict[str, str]:
    """The text of every field, by its path."""
    found = {name: as_text(values.get(name, default(name))) for name in (*SHARED, *OF_TASK[task])}
    texts = TEXT_DEFAULTS | dict(values.get("texts", {}))
    found |= {f"texts.{name}": as_text(texts.get(name, "")) for name in TEXTS}
    found |= {name: question_text.written(name, values.get(name, ())) for name in SHAPES}
    for group, shape in GROUPS.items():
        given = group_values(values, group)
        found |= {f"{group}.{name}": as_text(given.get(name, "")) for name in shape.model_fields}
    for index, arm in enumerate(values.get("arms", ())):
        found |= {f"arms.{index}.{name}": as_text(arm.get(name, "")) for name in ARM}
    return found


def group_values(values: Mapping[str, Any], group: str) -> Mapping[str, Any]:
    """What stands in the fields of a group: what was typed, else the defaults; without pay nothing."""
    if group == "pay":
        return {CURRENCY: "GBP"} | (values.get("pay") or {})
    defaults: dict[str, Any] = StudyDefinition.model_fields[group].default.model_dump()
    return defaults | (values.get(group) or {})


def default(name: str) -> Any:
    value = StudyDefinition.model_fields[name].default
    return "" if value is PydanticUndefined else value


def as_text(value: Any) -> str:
    """A value as it stands in a field; paragraphs are parted by an empty line."""
    if isinstance(value, bool):
        return "true" if value else ""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return "\n\n".join(str(each) for each in value)
    return "" if value is None else str(value)


def typed(fields: Mapping[str, str], task: Task) -> dict[str, Any]:
    """What was typed, in the shape of a definition; right or wrong is judged elsewhere."""
    values: dict[str, Any] = {name: as_value(fields, name, name) for name in (*SHARED, *OF_TASK[task])}
    values["texts"] = {name: as_value(fields, f"texts.{name}", name) for name in TEXTS}
    values |= {name: question_text.parsed(name, as_value(fields, name, name)) for name in SHAPES}
    values |= {group: typed_group(fields, group) for group in GROUPS}
    numbers = sorted({int(match[1]) for field in fields if (match := ARM_FIELD.fullmatch(field))})
    values["arms"] = [
        {name: as_value(fields, f"arms.{number}.{name}", name) for name in ARM} for number in numbers
    ]
    return values


def typed_group(fields: Mapping[str, str], group: str) -> dict[str, Any] | None:
    """The fields of a group that something was typed into; no pay at all where only a currency was chosen."""
    given = {name: as_value(fields, f"{group}.{name}", name) for name in GROUPS[group].model_fields}
    typed_in = {name: value for name, value in given.items() if value != ""}
    return None if group == "pay" and set(typed_in) <= {CURRENCY} else typed_in


def as_value(fields: Mapping[str, str], path: str, name: str) -> Any:
    text = fields.get(path, "").replace("\r\n", "\n").strip()
    if name in TICKS:
        return text == "true"
    if name in PARAGRAPHS:
        return [part.strip() for part in re.split(r"\n\s*\n", text) if part.strip()]
    if name in DECIMALS:
        return text.replace(",", ".")
    return text


def with_arms_changed(values: dict[str, Any], action: str) -> dict[str, Any]:
    """The values after the buttons "Add arm" and "Remove"."""
    arms = list(values["arms"])
    if action == "add-arm":
        taken = {arm["name"] for arm in arms}
        number = next(n for n in count(len(arms) + 1) if f"arm-{n}" not in taken)
        like = arms[-1] if arms else {"communication": "prototype", "bundle": "", "budget": "1", "places": ""}
        arms.append({**like, "overlay": True, "name": f"arm-{number}"})
    elif action.startswith("remove-arm-") and action.removeprefix("remove-arm-").isdecimal():
        gone = int(action.removeprefix("remove-arm-"))
        arms = [arm for index, arm in enumerate(arms) if index != gone]
    return {**values, "arms": arms}


def label(path: str) -> str:
    """How a field is called in the summary of mistakes."""
    if match := ARM_FIELD.fullmatch(path):
        return f"{ARM_LABELS.get(match[2], match[2].capitalize())} of arm {int(match[1]) + 1}"
    return LABELS.get(path, path)


def mistakes(errors: Mapping[str, str]) -> tuple[Mistake, ...]:
    """In the order of the page."""
    order = [start for starts in SECTIONS.values() for start in starts]

    def place(path: str) -> tuple[int, str]:
        found = [index for index, start in enumerate(order) if is_below(path, start)]
        return (found[0] if found else len(order), path)

    return tuple(Mistake(path, label(path), errors[path]) for path in sorted(errors, key=place))


def wrong_sections(errors: Mapping[str, str]) -> frozenset[str]:
    return frozenset(
        name
        for name, starts in SECTIONS.items()
        if any(is_below(path, start) for path in errors for start in starts if path != "texts.welcome")
        or (name == "about" and "texts.welcome" in errors)
    )


def is_below(path: str, start: str) -> bool:
    return path == start or path.startswith(f"{start}.")


def communications(task: Task) -> tuple[tuple[str, str], ...]:
    """Value and name of each communication that the task knows."""
    return tuple(
        (value, name) for value, name in COMMUNICATION_LABELS.items() if value in COMMUNICATIONS[task]
    )
