"""Bytes that a participant's browser loads for its first pages, everything included, against 400 kB.

Walks each page as a browser with an empty cache does: style sheets with their imports, scripts with the
modules that they import through the page's import map. Sizes are those of the bodies as they travel.
"""

import json
import re
from typing import NamedTuple
from urllib.parse import urljoin

import httpx

from benchmarks import table
from benchmarks.served import Served, served
from server.simulate import pages
from server.simulate.crowd import Crowd
from server.simulate.robot import DEVICE

AIM_KB = 400.0
STUDIES = ("parent-child", "traffic-junction")
LINKED = re.compile(r"""<(?:link|script|img)\b[^>]*?\b(?:href|src)="([^"]+)\"""")
IMPORT_MAP = re.compile(r"""<script type="importmap">(.*?)</script>""", re.DOTALL)
CSS_LINKED = re.compile(r"""(?:@import\s+(?:url\()?|url\()["']?([^"')]+)""")
COMMENT = re.compile(r"/\*.*?\*/|^\s*//[^\n]*", re.DOTALL | re.MULTILINE)
JS_IMPORTED = re.compile(r"""(?:\bfrom|\bimport)\s*\(?\s*["']([^"']+)["']""")


class Loaded(NamedTuple):
    """A page: its own bytes, and those of the files that it needed and that were not there yet."""

    html: int
    files: int
    requests: int


class Browser:
    """An HTTP client that loads what pages ask for, each file once."""

    def __init__(self, house: Served, study: str) -> None:
        signature = {"X-Hatlab-Robot": house.sign(study)}
        self.client = httpx.Client(base_url=house.url, headers=signature, follow_redirects=True)
        self.loaded: dict[str, int] = {}
        self.imports: dict[str, str] = {}

    def take(self, response: httpx.Response) -> Loaded:
        """Load what this page needs."""
        response.raise_for_status()
        before, count = sum(self.loaded.values()), len(self.loaded)
        for text in IMPORT_MAP.findall(response.text):
            self.imports |= json.loads(text).get("imports", {})
        for link in LINKED.findall(response.text):
            self.load(urljoin(str(response.url), link))
        return Loaded(weight(response), sum(self.loaded.values()) - before, len(self.loaded) - count)

    def load(self, url: str) -> None:
        """Load a file and whatever it asks for."""
        if url in self.loaded or not url.startswith("http"):
            return
        response = self.client.get(url)
        response.raise_for_status()
        self.loaded[url] = weight(response)
        kind = response.headers["content-type"]
        asked = CSS_LINKED if "css" in kind else JS_IMPORTED if "javascript" in kind else None
        text = COMMENT.sub("", response.text)
        for link in asked.findall(text) if asked and "/vendor/" not in url else ():
            self.load(urljoin(url, self.imports.get(link, link)))


def weight(response: httpx.Response) -> int:
    """Give the bytes of a body as it travelled."""
    return response.num_bytes_downloaded


def main() -> None:
    """Walk the first pages of each study and print the table."""
    with served("sqlite") as house:
        rows = [row for study in STUDIES for row in walk(house, study)]
    table.show(
        "What a participant's browser loads (an empty cache at the first page)",
        ("page", "HTML kB", "files kB", "files", "sum kB", f"of {AIM_KB:.0f} kB"),
        rows,
    )


def walk(house: Served, study: str) -> list[tuple[str, ...]]:
    """Go from the link to the first round."""
    browser = Browser(house, study)
    response = browser.client.get(Crowd(study, 1, 1).entry(0))
    rows = [line(f"{study}, consent (first page)", browser.take(response))]
    for ending, name, fields in (
        ("/consent", "instructions", {"agree": "yes", **DEVICE}),
        ("/next", "board", {}),
    ):
        form = pages.read(response.text).form_to(ending)
        assert form is not None, response.url
        response = browser.client.post(form.action, data=form.filled(**fields))
        rows.append(line(f"{study}, {name}", browser.take(response)))
    return rows


def line(name: str, page: Loaded) -> tuple[str, ...]:
    total = (page.html + page.files) / 1000
    share = f"{total / AIM_KB:.0%}"
    return (
        name,
        f"{page.html / 1000:.1f}",
        f"{page.files / 1000:.1f}",
        str(page.requests),
        f"{total:.1f}",
        share,
    )


if __name__ == "__main__":
    main()
