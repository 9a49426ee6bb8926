"""What a browser may know of a trial: `view_for` is all that leaves the server while one is played.

It is made from the participant's own observation, from what was heard (`Heard`, which the ghost computed) and
from where in the session the round stands (`Place`). No arm, condition, seed, or other car is in it; a
property test holds it to that.
"""

from dataclasses import dataclass
from typing import Any

from models.envs.parent_child import PARENT, ParentChild
from models.envs.traffic_junction import TrafficJunction
from server.domain.events import Saw
from server.domain.spec import Panel
from server.domain.trial import Trial

View = dict[str, Any]
HEADINGS = {(-1, 0): "up", (0, 1): "right", (1, 0): "down", (0, -1): "left"}


@dataclass(frozen=True, slots=True)
class Triangle:
    """A car that just spoke may be here."""

    row: int
    col: int
    likelihood: float
    """Rounded to what is sent, 3 decimals."""


@dataclass(frozen=True, slots=True)
class Heard:
    """What reaches the participant's screen of what was said in the present state."""

    messages: int = 0
    drawn: int = 0
    sign: int | None = None
    triangles: tuple[Triangle, ...] = ()
    overlay: bool = False
    """Whether this screen has triangles at all."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where in the session a round stands."""

    round: int
    number: int
    of: int
    block: int
    last: bool
    """The last round of its block."""


def saw(trial: Trial, heard: Heard) -> Saw:
    """What is on the screen, as numbers for the log."""
    row, col = at(trial, trial.cell)
    largest = max((triangle.likelihood for triangle in heard.triangles), default=0.0)
    return Saw(row, col, heard.messages, heard.drawn, largest if heard.overlay else None, heard.sign)


def view_for(trial: Trial, heard: Heard, place: Place, seq: int) -> View:
    """The participant's view as a JSON object; `seq` is the number of the last event."""
    views = {"parent": parent_view, "child": child_view, "driver": driver_view}
    return {
        "task": trial.spec.task.split("/")[0],
        "role": trial.spec.role,
        "phase": trial.spec.phase,
        "round": place.round,
        "number": place.number,
        "of": place.of,
        "block": place.block,
        "seq": seq,
        "limit": trial.spec.condition.step_limit,
        "step": trial.step,
        "actions": list(trial.choices),
        "over": over(trial, place) if trial.over else None,
        **views[trial.spec.role](trial, heard),
    }


def over(trial: Trial, place: Place) -> View:
    ended: View = {"outcome": trial.outcome, "steps": trial.step, "last": place.last}
    if trial.spec.role == "parent":
        ended["child"] = at(trial, child_cell(trial))
    return ended


def parent_view(trial: Trial, heard: Heard) -> View:
    env = trial.env
    assert isinstance(env, ParentChild)
    own, child = at(trial, trial.cell), at(trial, child_cell(trial))
    near = max(abs(own[0] - child[0]), abs(own[1] - child[1])) <= env.vision
    return {
        "size": env.dim,
        "vision": env.vision,
        "cell": own,
        "trail": [at(trial, cell) for cell in trial.trail],
        "child": child if near else None,
        **signs(trial, heard),
    }


def child_view(trial: Trial, heard: Heard) -> View:
    env = trial.env
    assert isinstance(env, ParentChild)
    sees = trial.spec.condition.child_sees_parent and not trial.over
    view = {
        "size": env.dim,
        "vision": env.vision,
        "cell": at(trial, trial.cell),
        "parent": at(trial, trial.trail[0]) if sees else None,
        **signs(trial, heard),
    }
    if trial.over:
        view["walk"] = [at(trial, cell) for cell in trial.trail]
    return view


def driver_view(trial: Trial, heard: Heard) -> View:
    env = trial.env
    assert isinstance(env, TrafficJunction)
    route = [at(trial, cell) for cell in trial.route]
    return {
        "size": env.shape[0],
        "cell": at(trial, trial.cell),
        "heading": heading(route, trial.progress),
        "route": route,
        "position": trial.progress,
        "triangles": [[t.row, t.col, t.likelihood] for t in heard.triangles],
    }


def roads(trial: Trial) -> View | None:
    """The lanes of the map, which never change; None where there are none."""
    env = trial.env
    if not isinstance(env, TrafficJunction):
        return None
    side = env.shape[1]
    cells = {int(cell) for route in env.routes for cell in route}
    rows = [row for row in range(side) if all(row * side + col in cells for col in range(side))]
    columns = [col for col in range(side) if all(row * side + col in cells for row in range(side))]
    return {"rows": rows, "columns": columns}


def signs(trial: Trial, heard: Heard) -> View:
    panel = trial.spec.condition.panel
    return {
        "sign": heard.sign,
        "signs": sign_list(panel) if panel else [],
        "blank": trial.spec.condition.blank,
    }


def sign_list(panel: Panel) -> list[View]:
    """By number on screen, so that the order says nothing about tokens."""
    placed = sorted(zip(panel.number_at_position, panel.positions, strict=True))
    return [{"number": number, "x": x, "y": y} for number, (x, y) in placed]


def heading(route: list[list[int]], position: int) -> str:
    """Which way the car goes next; on the last cell, and beyond it, the way it came."""
    index = min(position, len(route) - 2)
    (row, col), (row_next, col_next) = route[index], route[index + 1]
    return HEADINGS[row_next - row, col_next - col]


def child_cell(trial: Trial) -> int:
    return int(trial.env.cell_of(trial.world)[0, 1 - PARENT])


def at(trial: Trial, cell: int) -> list[int]:
    """[row, column], counted from 0 at the upper left."""
    return list(divmod(cell, trial.env.shape[1]))
