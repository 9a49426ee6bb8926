"""Validation errors of a study as sentences for whoever fills in the form, by the path of the field."""

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from server.domain.study import StudyDefinition

PATTERNS = {
    "name": "Use small letters, digits and hyphens, at most 48.",
    "slug": "Use small letters, digits and hyphens, at most 48.",
    "completion_code": "Use letters, digits, hyphens and underscores, at most 64.",
    "completion_url": "Begin with https:// and leave no spaces, or leave it empty.",
}
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
        return None, {field_of(each["loc"]): sentence_of(each) for each in reversed(error.errors())}
    found = wrong_together(study)
    return study, {path: sentence(path, text, study) for path, text in found.items()}


def field_of(location: tuple[int | str, ...]) -> str:
    """The field on the page; all paragraphs of the consent text are one."""
    parts = [str(part) for part in location]
    return ".".join(parts[:2] if parts[:2] == ["texts", "consent"] else parts)


def sentence_of(error: ErrorDetails) -> str:
    last = str(error["loc"][-1]) if error["loc"] else ""
    if error["type"] == "string_pattern_mismatch":
        blank = not str(error["input"]).strip()
        return "Fill this in." if blank else PATTERNS.get(last, "This cannot be used here.")
    template = SENTENCES.get(error["type"])
    return template.format(**error.get("ctx", {})) if template else "This cannot be used here."


def sentence(path: str, text: str, study: StudyDefinition) -> str:
    """The domain's words as a sentence that can stand below the field."""
    parts = path.split(".")
    if parts[0] == "arms" and parts[-1] == "budget":
        return f"Budget {study.arms[int(parts[1])].budget:g} {text}."
    if text.startswith(("was ", "has ", "needs ", "offers ")):
        subject = "This communication" if parts[-1] == "communication" else "This agent"
        return f"{subject} {text}."
    first = text.split(maxsplit=1)[0]
    is_name = not first.isalpha() or first in {arm.name for arm in study.arms}
    return f"{text if is_name else text[0].upper() + text[1:]}."
