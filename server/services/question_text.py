"""Questions as TOML, as an experimenter reads and types them: quiz, attention checks, questionnaires.

The text is what `studies/*.toml` hold; comments are not kept. A text that cannot be read stays as it was
typed.
"""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from server.domain import canonical
from server.domain.questionnaire import AttentionCheck, Item, Questionnaire, QuizQuestion

SHAPES: Mapping[str, type[BaseModel]] = {
    "quiz": QuizQuestion,
    "attention": AttentionCheck,
    "questionnaires": Questionnaire,
}
"""Fields of a study that are written as TOML, and what one of their parts is."""
ORDER = (
    *("key", "role", "after", "title", "lead", "when", "text", "kind", "options", "answer"),
    *("low", "high", "minimum", "maximum", "step", "required"),
)
ALWAYS = frozenset({"when"})
"""Said even where it is the default."""
BARE = re.compile(r"[A-Za-z0-9_-]+")


def parsed(name: str, text: str) -> Any:
    """The list that `text` describes; the text itself where it describes none."""
    try:
        return listed(name, text)
    except (ValueError, TypeError, RecursionError):
        return text


def listed(name: str, text: str) -> list[Any]:
    """The list in a text.

    Raises:
        ValueError: it is no TOML, or something else stands beside the list.
        TypeError: a date or a time, which no question has.
        RecursionError: nothing that a person has typed.
    """
    values = tomllib.loads(text)
    canonical.dumps(values)
    if others := [key for key in values if key != name]:
        raise ValueError(f"only [[{name}]] may stand here, not {others[0]}")
    if not isinstance(found := values.get(name, []), list):
        raise ValueError(f"begin each part with [[{name}]]")  # noqa: TRY004 (parsed() tells no errors apart)
    return found


def mistake(name: str, text: str) -> str:
    """What is wrong with a text, as a sentence; empty if nothing is."""
    try:
        listed(name, text)
    except RecursionError:
        return "This is nested too deeply."
    except TypeError:
        return "There is a date or a time, which no question has. Put it into quotes."
    except ValueError as error:
        said = str(error).rstrip(".")
        return f"{said[:1].upper()}{said[1:]}."
    return ""


def written(name: str, value: Any) -> str:
    """The text of a list, without what is left at its default; a text stays as it is."""
    if isinstance(value, str):
        return value
    if not isinstance(value, Sequence) or not all(isinstance(part, Mapping) for part in value):
        return "" if value is None else f"{name} = {inline(value)}"
    tables = ["\n".join(table(name, part, SHAPES[name])) for part in value]
    return "\n\n".join(tables)


def table(name: str, part: Mapping[str, Any], shape: type[BaseModel]) -> Iterator[str]:
    """The lines of one part, and of the items in it."""
    yield f"[[{name}]]"
    items = part.get("items")
    has_items = isinstance(items, Sequence) and items and all(isinstance(item, Mapping) for item in items)
    for key in sorted(part, key=lambda key: (ORDER.index(key) if key in ORDER else len(ORDER), key)):
        if not (key == "items" and has_items) and not is_default(shape, key, part[key]):
            yield f"{quoted(key)} = {inline(part[key])}"
    if has_items:
        for item in part["items"]:
            yield ""
            yield from table(f"{name}.items", item, Item)


def is_default(shape: type[BaseModel], key: str, value: Any) -> bool:
    """Whether a value goes without saying; TOML has no word for None."""
    field = shape.model_fields.get(key)
    if value is None:
        return True
    if field is None or field.is_required() or key in ALWAYS:
        return False
    default = list(field.default) if isinstance(field.default, tuple) else field.default
    return value is default if isinstance(default, bool) else bool(value == default)


def inline(value: Any) -> str:
    """One value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.0f}" if value.is_integer() else repr(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, Mapping):
        inside = ", ".join(
            f"{quoted(key)} = {inline(each)}" for key, each in value.items() if each is not None
        )
        return f"{{ {inside} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(inline(each) for each in value if each is not None)}]"
    return string(str(value))


def quoted(key: str) -> str:
    return key if BARE.fullmatch(key) else string(key)


def string(text: str) -> str:
    """A basic string: JSON's escapes are TOML's, and TOML wants one more."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
