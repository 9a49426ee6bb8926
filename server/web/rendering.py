"""Templates to responses, and the addresses of static files.

Templates may call `static("css/hatlab.css")`; `import_map` is the text of the one inline script that the
Content-Security-Policy allows, by `IMPORT_MAP_SHA256`.
"""

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

from fastapi.responses import HTMLResponse
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from server.web.pages import Page
from server.web.security import policy

ROOT = Path(__file__).parents[2]
TEMPLATES = ROOT / "templates"
STATIC = ROOT / "static"


@cache
def static_version() -> str:
    """Hash over every static file: a new content is a new address, so that answers may be cached for ever."""
    digest = hashlib.sha256()
    for file in sorted(path for path in STATIC.rglob("*") if path.is_file()):
        digest.update(file.relative_to(STATIC).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:12]


def static_url(path: str) -> str:
    """The address of `static/<path>`."""
    return f"/static/v-{static_version()}/{path}"


@cache
def import_map() -> str:
    """static/importmap.json (paths below static/) with this version's addresses; `hatlab/` is static/js/."""
    file = STATIC / "importmap.json"
    imports: dict[str, str] = {"hatlab/": "js/"}
    if file.exists():
        imports |= json.loads(file.read_text(encoding="utf-8"))["imports"]
    addresses = {name: static_url(path) for name, path in imports.items()}
    return json.dumps({"imports": addresses}, sort_keys=True, separators=(",", ":"))


def import_map_sha256() -> str:
    """The hash source that allows the import map in script-src."""
    return base64.b64encode(hashlib.sha256(import_map().encode()).digest()).decode()


@cache
def environment() -> Environment:
    """Jinja as all pages use it: escaped, and an unknown name is an error."""
    jinja = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        auto_reload=False,
    )
    jinja.globals["static"] = static_url
    # JSON cannot hold "</script" here: import_map() has only names and paths of this repository.
    jinja.globals["import_map"] = Markup(import_map())  # noqa: S704
    return jinja


def context(page: Page) -> dict[str, Any]:
    """The template's variables: the fields of the page's dataclass, unchanged."""
    if not is_dataclass(page):
        raise TypeError(f"{type(page).__name__} is no dataclass")
    return {each.name: getattr(page, each.name) for each in fields(page)}


def html(
    page: Page,
    status: int = 200,
    *,
    frames: Iterable[str] = (),
    forms: Iterable[str] = (),
    headers: Mapping[str, str] | None = None,
) -> HTMLResponse:
    """The page as a response that is never stored in a cache.

    `frames` are the hosts that may embed it, `forms` those that its forms may post to (beside this server).
    """
    response = HTMLResponse(
        environment().get_template(page.template).render(context(page)), status_code=status
    )
    response.headers["cache-control"] = "no-store"
    response.headers["content-security-policy"] = policy(import_map_sha256(), frames=frames, forms=forms)
    response.headers.update(headers or {})
    return response
