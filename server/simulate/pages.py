"""What a robot reads from a page: its forms, its `#page-data`, and the texts of its elements with an id.

Only what a browser would have; a standard HTML parser and no knowledge of templates.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from html.parser import HTMLParser
from typing import Any

Attributes = list[tuple[str, str | None]]
VOID = frozenset(
    {"area", "base", "br", "col", "hr", "img", "input", "link", "meta", "source", "track", "wbr"}
)


@dataclass(slots=True)
class Form:
    """A form with the fields that a browser would send, and its buttons as (name, value)."""

    action: str
    method: str
    fields: dict[str, str] = field(default_factory=dict)
    ticks: dict[str, str] = field(default_factory=dict)
    buttons: list[tuple[str, str]] = field(default_factory=list)

    def filled(self, **values: str) -> dict[str, str]:
        """Give what is sent when every box is ticked and these fields are set, of those that exist.

        Of radio buttons the first is ticked where nothing else is asked for.
        """
        own = {**self.fields, **self.ticks}
        known = {name: value for name, value in values.items() if name in own or self.offers(name, value)}
        return {**self.fields, **self.ticks, **known}

    def offers(self, name: str, value: str) -> bool:
        return (name, value) in self.buttons


@dataclass(frozen=True, slots=True)
class Page:
    """A page as far as a robot reads it."""

    title: str
    forms: tuple[Form, ...]
    data: Mapping[str, Any] | None
    texts: Mapping[str, str]
    """Text of each element with an id."""
    classes: frozenset[str]
    """Classes of the body."""

    def form_to(self, ending: str) -> Form | None:
        """Find the form whose address ends so."""
        return next((form for form in self.forms if form.action.partition("?")[0].endswith(ending)), None)


def read(html: str) -> Page:
    """Read a page.

    >>> page = read('<body class="a"><form action="/x" method="post"><input name="n" value="1"></form>')
    >>> page.form_to("/x").fields
    {'n': '1'}
    """
    reader = _Reader()
    reader.feed(html)
    reader.close()
    data = reader.texts.get("page-data")
    return Page(
        title=reader.title.strip(),
        forms=tuple(reader.forms),
        data=json.loads(data) if data else None,
        texts={key: " ".join(text.split()) for key, text in reader.texts.items()},
        classes=frozenset(reader.classes.split()),
    )


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.forms: list[Form] = []
        self.texts: dict[str, str] = {}
        self.title = ""
        self.classes = ""
        self._open: list[tuple[str, str | None]] = []
        self._form: Form | None = None

    def handle_starttag(self, tag: str, attrs: Attributes) -> None:
        given = {name: value or "" for name, value in attrs}
        if tag not in VOID:
            self._open.append((tag, given.get("id")))
            if given.get("id"):
                self.texts.setdefault(given["id"], "")
        if tag == "body":
            self.classes = given.get("class", "")
        elif tag == "form":
            self._form = Form(given.get("action", ""), given.get("method", "get").lower())
            self.forms.append(self._form)
        elif self._form is not None:
            _take_control(self._form, tag, given)

    def handle_startendtag(self, tag: str, attrs: Attributes) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag == "form":
            self._form = None
        if any(name == tag for name, _ in self._open):
            while self._open.pop()[0] != tag:
                pass

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1][0] == "title":
            self.title += data
        for _, key in self._open:
            if key:
                self.texts[key] += data


def _take_control(form: Form, tag: str, given: Mapping[str, str]) -> None:
    name, value, kind = given.get("name", ""), given.get("value", ""), given.get("type", "text")
    if not name:
        return
    if tag == "button" or kind == "submit":
        form.buttons.append((name, value))
    elif tag == "input" and kind in {"checkbox", "radio"}:
        form.ticks.setdefault(name, value or "on")
    elif tag in {"input", "textarea", "select"}:
        form.fields[name] = value
