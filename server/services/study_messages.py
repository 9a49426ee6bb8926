"""Validation errors of a study as sentences for whoever fills in the form, by the path of the field."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from server.domain.study import StudyDefinition
from server.services import question_text
from server.services.question_text import SHAPES

PATTERNS = {
    "name": "Use small letters, digits and hyphens, at most 48.",
    "slug": "Use small letters, digits and hyphens, at most 48.",
    "key": "Use small letters, digits and underscores, a letter first, at most 40.",
    "language": "Use a language's code, such as en or pt-BR.",
    "completion_code": "Use letters, digits, hyphens and underscores, at most 64.",
    "completion_url": "Begin with https:// (on this machine http://), with no spaces, or leave it empty.",
}
PATTERNS |= dict.fromkeys(("screened_out", "failed", "withdrawn"), PATTERNS["completion_code"])
SENTENCES = {
    "missing": "Fill this in.",
    "string_too_short": "Fill this in.",
    "none_required": "Leave this empty.",
    "string_too_long": "Use at most {max_length} characters.",
    "int_parsing": "Enter a whole number.",
    "int_type": "Enter a whole number.",
    "float_type": "Enter a number, such as 0.5.",
    "string_type": "Fill this in.",
    "int_parsing_size": "Enter a smaller number.",
    "int_from_float": "Enter a whole number.",
    "float_parsing": "Enter a number, such as 0.5.",
    "finite_number": "Enter a number, such as 0.5.",
    "greater_than": "Enter more than {gt:g}.",
    "greater_than_equal": "Enter at least {ge}.",
    "less_than": "Enter less than {lt:g}.",
    "less_than_equal": "Enter at most {le}.",
    "too_short": "Write at least one.",
    "too_long": "Use at most {max_length}.",
    "literal_error": "Choose one from the list.",
}
IN_TEXTS = {
    "missing": "is missing.",
    "string_type": "must be a text in quotes.",
    "string_too_short": "is empty.",
    "extra_forbidden": "is no name that is known here.",
    "literal_error": "must be {expected}.",
    "bool_parsing": "must be true or false.",
    "bool_type": "must be true or false.",
    "tuple_type": "must be a list.",
    "model_type": "must be a table.",
}
"""What is said of a part of a TOML text, after its name."""
PLURALS = {"quiz": "question", "attention": "check", "questionnaires": "questionnaire", "items": "item"}


def mistakes_of(
    values: Mapping[str, Any], wrong_together: Callable[[StudyDefinition], Mapping[str, str]]
) -> tuple[StudyDefinition | None, dict[str, str]]:
    """The definition if every field is right by itself, and one sentence for each wrong field.

    Args:
        values: what was typed.
        wrong_together: fields that are wrong only beside others, as the domain says them.
    """
    try:
        study = StudyDefinition.model_validate(values)
    except ValidationError as error:
        found = {field_of(each["loc"]): sentence_of(each) for each in reversed(error.errors())}
        return None, found | unreadable(values)
    told = {path: sentence(path, text, study) for path, text in wrong_together(study).items()}
    return study, {field_of(tuple(path.split("."))): text for path, text in reversed(told.items())}


def unreadable(values: Mapping[str, Any]) -> dict[str, str]:
    """What is wrong with each text that could not be read as TOML."""
    texts = {name: values[name] for name in SHAPES if isinstance(values.get(name), str)}
    found = {name: question_text.mistake(name, text) for name, text in texts.items()}
    return {name: text for name, text in found.items() if text}


def field_of(location: Sequence[int | str]) -> str:
    """The field on the page: the consent text is one, a code is one, and so are all questions of a kind."""
    parts = [str(part) for part in location]
    if parts[0] in SHAPES:
        return parts[0]
    whole = parts[:2] in (["texts", "consent"], ["texts", "instructions"]) or parts[0] == "codes"
    return ".".join(parts[:2] if whole else parts)


def place_of(location: Sequence[int | str]) -> str:
    """Where in a TOML text something stands: `questionnaire 2, item 3, options`."""
    parts, named = [str(part) for part in location], []
    for part, following in zip(parts, [*parts[1:], ""], strict=True):
        if part in PLURALS and following.isdecimal():
            named.append(f"{PLURALS[part]} {int(following) + 1}")
        elif not part.isdecimal() and part not in SHAPES:
            named.append(part)
    return ", ".join(named)


def sentence_of(error: ErrorDetails) -> str:
    location = error["loc"]
    if location and location[0] in SHAPES:
        place, said = place_of(location), in_text(error)
        return f"{place[:1].upper()}{place[1:]}: {said}" if place else f"{said[:1].upper()}{said[1:]}"
    last = field_of(location).rpartition(".")[2] if location else ""
    if error["type"] == "string_pattern_mismatch":
        blank = not str(error["input"]).strip()
        return "Fill this in." if blank else PATTERNS.get(last, "This cannot be used here.")
    template = SENTENCES.get(error["type"])
    return template.format(**error.get("ctx", {})) if template else "This cannot be used here."


def in_text(error: ErrorDetails) -> str:
    """What is wrong with one part of a TOML text."""
    kind, context = error["type"], error.get("ctx", {})
    if kind == "value_error":
        return f"{context['error']}."
    if kind == "string_pattern_mismatch":
        return PATTERNS["key"][:1].lower() + PATTERNS["key"][1:]
    template = IN_TEXTS.get(kind) or SENTENCES.get(kind, "this cannot be used here.")
    said = template.format(**context)
    return said[:1].lower() + said[1:]


def sentence(path: str, text: str, study: StudyDefinition) -> str:
    """The domain's words as a sentence that can stand below the field."""
    parts = path.split(".")
    if parts[0] in SHAPES and (place := place_of(parts)):
        return f"{place[:1].upper()}{place[1:]}: {text}."
    if parts[0] == "arms" and parts[-1] == "budget":
        return f"Budget {study.arms[int(parts[1])].budget:g} {text}."
    if text.startswith(("was ", "has ", "needs ", "offers ")):
        subject = "This communication" if parts[-1] == "communication" else "This agent"
        return f"{subject} {text}."
    first = text.split(maxsplit=1)[0]
    is_name = not first.isalpha() or first in {arm.name for arm in study.arms}
    return f"{text if is_name else text[0].upper() + text[1:]}."
