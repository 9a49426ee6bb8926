"""Templates against the dataclasses that fill them."""

from dataclasses import fields
from pathlib import Path

import pytest
from jinja2 import UndefinedError, meta

from server.web import pages
from server.web.pages import ErrorPage, Page
from server.web.rendering import STATIC, TEMPLATES, environment, html, static_url, static_version

PAGES: list[type[Page]] = [
    pages.ConsentPage,
    pages.InstructionsPage,
    pages.PlayPage,
    pages.EndPage,
    pages.FormPage,
    pages.WithdrawPage,
    pages.MessagePage,
    pages.ErrorPage,
]


def names_used(template: str) -> set[str]:
    """Variables of a template and of all that it extends, includes or imports."""
    jinja = environment()
    tree = jinja.parse((TEMPLATES / template).read_text(encoding="utf-8"))
    used = set(meta.find_undeclared_variables(tree))
    for other in meta.find_referenced_templates(tree):
        assert other is not None, f"{template} names a template by a variable"
        used |= names_used(other)
    return used - set(jinja.globals)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.__name__)
def test_a_template_uses_only_what_its_page_gives(page: type[Page]) -> None:
    given = {each.name for each in fields(page)}  # type: ignore[arg-type]
    assert names_used(page.template) <= given


def test_an_unknown_name_is_an_error_and_not_an_empty_string() -> None:
    with pytest.raises(UndefinedError):
        environment().from_string("{{ nobody_gave_this }}").render()


def test_what_a_page_says_is_escaped() -> None:
    body = bytes(html(ErrorPage(404, "<b>", ("a & b",))).body).decode()
    assert "&lt;b&gt;" in body
    assert "a &amp; b" in body


def test_data_for_scripts_cannot_end_their_element() -> None:
    text = environment().from_string("{{ data|tojson }}").render(data={"x": "</script><!--"})
    assert "<" not in text


def test_a_page_is_never_kept_in_a_cache_and_brings_its_policy() -> None:
    response = html(ErrorPage(404, "h", ()), 404)
    assert response.status_code == 404
    assert response.headers["cache-control"] == "no-store"
    assert "script-src 'self' 'sha256-" in response.headers["content-security-policy"]


def test_the_address_of_a_static_file_changes_with_the_content() -> None:
    assert static_url("css/hatlab.css") == f"/static/v-{static_version()}/css/hatlab.css"
    assert len(static_version()) == 12


def test_every_static_file_that_a_template_names_exists() -> None:
    for template in Path(TEMPLATES).rglob("*.html"):
        text = template.read_text(encoding="utf-8")
        named = [part.split("'")[0] for part in text.split("static('")[1:]]
        named += [part.split('"')[0] for part in text.split('static("')[1:]]
        for path in named:
            assert (STATIC / path).is_file(), f"{template.name} names static/{path}"
