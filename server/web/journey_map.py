"""docs/journey.md: every state, every event, and what is shown, printed from the code that decides it.

`make docs` writes the page; a test compares it.
"""

import sys
from collections.abc import Iterator, Mapping
from typing import get_args

from server.domain import participation
from server.domain.participation import BEFORE, ENDS, STAGES, Event, State
from server.domain.plan import PageKind
from server.web import ends

PAGES: Mapping[PageKind, tuple[str, str]] = {
    "instructions": ("How to play", "read, check the keys, go on"),
    "practice": ("The board, practice rounds", "play them; the page turns by itself"),
    "quiz": ("Questions about the game", "answer; a wrong one costs a try"),
    "play": ("The board, main rounds; in between an attention check", "play, answer"),
    "survey": ("Questionnaires, one after the other", "answer"),
    "probe": ("The board and the signs: where does each point?", "mark, or leave out"),
    "complete": ("The code, and the way back", "hand in the code"),
}
"""What a page of the plan shows, and what is to be done there."""
ENTRY: Mapping[State, tuple[str, str]] = {
    State.INVITED: ("Entry page: text, device check, consent", "agree or decline"),
    State.SCREENED: ("The same, with the device check passed", "agree or decline"),
}
LAST = {State.DECLINED: ("You do not take part", "nothing; the way back, where there is one")}
NEXT: Mapping[State, str] = {
    State.SCREENED_OUT: "hand in the code for it, or return the place",
    State.FINISHED: "hand in the code",
    State.FAILED: "hand in the code",
    State.TIMED_OUT: "take a new place at the marketplace: its link leads back in",
    State.WITHDRAWN: "hand in the code for it, or return the place",
    State.RETURNED: "nothing; a new place leads back in",
    State.REJECTED: "write to the contact if it seems wrong",
}
PREFACE = """# The journey of a participant

This page is printed by `python -m server.web.journey_map` (`make docs`) from the table that moves people,
`server/domain/participation.py`. It is a total function: of every state and every event it says what
follows, and most events move nobody who is not waiting for them. Nobody is ever rejected by hatlab;
`rejected` and `returned` are what a marketplace tells.

What is stored of somebody who takes part is a status (`active`, or an end) and a page of their plan. The
stages of whoever is active follow from the page. `journey.csv` of an export holds every move.

"""


def page() -> str:
    return "".join(sections())


def sections() -> Iterator[str]:
    yield PREFACE
    yield f"## The moves\n\n```mermaid\n{participation.diagram()}\n```\n\n"
    yield "`took again` leads back to the stage of the page that was left.\n\n"
    yield "## What each state shows\n\n| state | page | what to do there |\n|---|---|---|\n"
    for state in State:
        heading, todo = shown(state)
        yield f"| `{state}` | {heading} | {todo} |\n"
    yield "\n## The pages of the plan\n\n| page | stage | shows | what to do there |\n|---|---|---|---|\n"
    for kind, (shows, todo) in PAGES.items():
        yield f"| `{kind}` | {', '.join(f'`{state}`' for state in stages_of(kind))} | {shows} | {todo} |\n"
    yield "\n## Every state and every event\n\nEmpty: nothing moves.\n\n"
    yield from matrix()


def shown(state: State) -> tuple[str, str]:
    """The heading of a state's page, and the next step that it names."""
    if state in ENTRY:
        return ENTRY[state]
    if state in LAST:
        return LAST[state]
    if state in NEXT:
        return ends.HEADINGS[state], NEXT[state]
    kinds = [kind for kind in PAGES if state in stages_of(kind)]
    return "; ".join(PAGES[kind][0] for kind in kinds), "; ".join(PAGES[kind][1] for kind in kinds)


def stages_of(kind: PageKind) -> list[State]:
    """The states of somebody on a page of this kind."""
    if kind == "complete":
        return [State.FINISHED, State.FAILED]
    found = {
        participation.stage_of(f"{kind}:{block}", last_block=last, begun=begun)
        for block in ((1, 0) if kind == "survey" else (0,) if kind == "probe" else (1,))
        for last in (False, True)
        for begun in (False, True)
    }
    return [stage for stage in STAGES if stage in found]


def matrix() -> Iterator[str]:
    """One row an event, one column a state; ends that nothing moves are left out and named below."""
    still = [state for state in State if not any(participation.moves(state, event) for event in Event)]
    columns = [state for state in State if state not in still]
    yield f"| event | {' | '.join(f'`{state}`' for state in columns)} |\n|---|{'---|' * len(columns)}\n"
    for event in Event:
        cells = (cell(state, event) for state in columns)
        yield f"| `{event}` | {' | '.join(cells)} |\n"
    yield f"\nNothing moves anybody who is {', '.join(f'`{state}`' for state in still)}.\n"


def cell(state: State, event: Event) -> str:
    return f"`{participation.after(state, event)}`" if participation.moves(state, event) else ""


assert set(PAGES) == set(get_args(PageKind))
assert {*ENTRY, *LAST, *NEXT, *STAGES} == {*BEFORE, *ENDS, *STAGES}

if __name__ == "__main__":
    sys.stdout.write(page())
