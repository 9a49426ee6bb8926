"""The worker's side of the fake Mechanical Turk as HTML: the list of HITs, a preview, a task in its frame."""

from collections.abc import Iterable
from html import escape
from urllib.parse import urlencode, urlsplit

from server.recruitment.mturk import NO_ASSIGNMENT
from server.simulate.mturk_market import Assignment, Hit, Market

STYLE = """
body { margin: 0; font: 16px/1.5 system-ui, sans-serif; color: #1c1f23; background: #f6f7f8; }
header { display: flex; gap: 16px; align-items: center; padding: 8px 16px; border-bottom: 1px solid #c9ced4; }
header b { flex: 1; }
form { display: inline; }
main { max-width: 720px; margin: 32px auto; padding: 0 16px; }
li { margin: 0 0 16px; }
button, input { font: inherit; min-height: 44px; }
iframe { display: block; width: 100%; border: 0; }
.whole { height: calc(100vh - 62px); }
"""
DEFAULT_WORKER = "AFAKEWORKER"


def document(title: str, body: str) -> str:
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style></head><body>{body}</body></html>"
    )


def listing(market: Market, worker: str) -> str:
    """What this worker finds."""
    items = "".join(item(market, hit, worker) for hit in market.offered(worker))
    return document(
        "Fake MTurk",
        f"<header><b>Fake MTurk: worker {escape(worker)}</b>"
        '<form><label>Be worker <input name="worker" pattern="A[A-Z0-9]+" required></label> '
        "<button>Change</button></form></header>"
        f"<main><h1>HITs</h1><ul>{items or '<li>There is nothing to do.</li>'}</ul>"
        '<p><a href="/fake/ledger">Ledger</a></p></main>',
    )


def item(market: Market, hit: Hit, worker: str) -> str:
    kind = market.type_of(hit)
    address = f"/worker/preview/{hit.id}?{urlencode({'worker': worker})}"
    return (
        f'<li><a href="{escape(address)}">{escape(kind["Title"])}</a> (${escape(kind["Reward"])}, '
        f"{hit.places - len(market.taken(hit))} left)<br>{escape(kind['Description'])}</li>"
    )


def preview(market: Market, hit: Hit, worker: str, site: str) -> str:
    """The task before it is accepted: the frame gets no assignment and no worker."""
    accept = button(f"/worker/accept/{hit.id}", "Accept", (("worker", worker),))
    given = {"assignmentId": NO_ASSIGNMENT, "hitId": hit.id, "turkSubmitTo": site}
    return framed(market, hit, f"Preview{accept}", given)


def task(market: Market, assignment: Assignment, site: str) -> str:
    hit = market.hits[assignment.hit_id]
    give_back = button(f"/worker/return/{assignment.id}", "Return", ())
    given = {
        "assignmentId": assignment.id,
        "hitId": hit.id,
        "workerId": assignment.worker,
        "turkSubmitTo": site,
    }
    return framed(market, hit, f"Worker {escape(assignment.worker)}{give_back}", given)


def framed(market: Market, hit: Hit, controls: str, given: dict[str, str]) -> str:
    glue = "&" if urlsplit(hit.url).query else "?"
    size = f'height="{hit.frame_px}"' if hit.frame_px else 'class="whole"'
    title, address = market.type_of(hit)["Title"], escape(hit.url + glue + urlencode(given))
    return document(
        title,
        f"<header><b>{escape(title)}</b>{controls}</header>"
        f'<iframe id="task" title="The task" {size} src="{address}"></iframe>',
    )


def button(action: str, label: str, fields: Iterable[tuple[str, str]]) -> str:
    hidden = "".join(
        f'<input type="hidden" name="{escape(name)}" value="{escape(value)}">' for name, value in fields
    )
    return f'<form method="post" action="{escape(action)}">{hidden}<button>{escape(label)}</button></form>'


def said(title: str, text: str) -> str:
    return document(title, f'<main><h1 id="said">{escape(title)}</h1><p>{escape(text)}</p></main>')
