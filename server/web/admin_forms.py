"""The form of a study: its fields as text, what was typed as values, and how each field is called."""

import re
from collections.abc import Mapping
from itertools import count
from typing import Any

from pydantic_core import PydanticUndefined

from server.domain.study import COMMUNICATIONS, StudyDefinition, Task
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
)
OF_TASK: dict[Task, tuple[str, ...]] = {
    "parent_child": ("panel_bundle", "child_sees_parent"),
    "traffic_junction": ("arrival",),
}
TEXTS = ("welcome", "consent", "consent_version", "agree", "declined", "complete")
ARM = ("name", "communication", "bundle", "budget", "overlay", "places")
TICKS = frozenset({"child_sees_parent", "overlay"})
DECIMALS = frozenset({"arrival", "budget"})
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
    "texts.declined": "After declining",
    "texts.complete": "After the last round",
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
    "texts": ("texts", "contact"),
    "recruitment": ("duration_min", "reward_text", "lease_min", "completion_code", "completion_url"),
}
COMMUNICATION_LABELS = {
    "prototype": "Prototype",
    "one-hot": "One-hot",
    "shuffled": "Prototype, shuffled places",
}


def shown(values: Mapping[str, Any], task: Task) -> dict[str, str]:
    """The text of every field, by its path."""
    found = {name: as_text(values.get(name, default(name))) for name in (*SHARED, *OF_TASK[task])}
    texts = values.get("texts", {})
    found |= {f"texts.{name}": as_text(texts.get(name, "")) for name in TEXTS}
    for index, arm in enumerate(values.get("arms", ())):
        found |= {f"arms.{index}.{name}": as_text(arm.get(name, "")) for name in ARM}
    return found


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
    numbers = sorted({int(match[1]) for field in fields if (match := ARM_FIELD.fullmatch(field))})
    values["arms"] = [
        {name: as_value(fields, f"arms.{number}.{name}", name) for name in ARM} for number in numbers
    ]
    return values


def as_value(fields: Mapping[str, str], path: str, name: str) -> Any:
    text = fields.get(path, "").replace("\r\n", "\n").strip()
    if name in TICKS:
        return text == "true"
    if name == "consent":
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
