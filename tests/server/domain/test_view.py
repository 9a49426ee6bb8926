"""What a browser may know. What participants cannot tell apart gives the same bytes: the leak test."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from models.envs import registry
from models.envs.parent_child import ParentChild
from models.envs.traffic_junction import TrafficJunction
from models.vocabulary import SILENT
from server.domain import canonical, trial
from server.domain.events import Said, silence
from server.domain.plan import permutation
from server.domain.spec import BundleName, Condition, Panel, TrialSpec
from server.domain.trial import Trial
from server.domain.view import Heard, Place, Triangle, heading, roads, view_for
from server.ghost.translation import translate
from tests.fakes import fake_lexicon

MEDIUM = registry.make("traffic_junction/medium")
SEARCH = registry.make("parent_child")
assert isinstance(MEDIUM, TrafficJunction)
assert isinstance(SEARCH, ParentChild)
LEXICON = fake_lexicon(16, MEDIUM.cells, seed=3)
POSITIONS = tuple((round(0.1 * i, 3), round(1 - 0.09 * i, 3)) for i in range(9))
PLACE = Place(round=7, number=6, of=20, block=1, last=False)
PAIRS = settings(max_examples=700, deadline=None, suppress_health_check=[HealthCheck.too_slow])
SEEDS = st.integers(0, 2**32 - 1)


@dataclass(frozen=True)
class Hidden:
    """Everything that a participant must not learn, drawn anew for each of the two situations."""

    draw: np.random.Generator

    def spec(self, role: str, panel: Panel | None, *, sees_parent: bool = True) -> TrialSpec:
        driver = role == "driver"
        seats = ["policy"] * (10 if driver else 2)
        seats[-1 if role != "parent" else 0] = "human"
        return TrialSpec(
            task=MEDIUM.name if driver else SEARCH.name,
            task_version=1,
            seed=int(self.draw.integers(2**53)),
            start="human" if driver else "init",
            role=role,
            phase="main",
            bundle=BundleName(name=f"arm-{self.draw.integers(9)}", sha256=str(self.draw.integers(2**40))),
            scripted=None,
            seats=tuple(seats),
            condition=Condition(
                communication=str(self.draw.choice(["prototype", "one-hot", "shuffled"])),
                budget=float(self.draw.choice([1.0, 0.5, 0.3])),
                overlay=True,
                step_limit=40 if driver else 20,
                arrival=float(self.draw.choice([0.05, 0.2])),
                child_sees_parent=sees_parent,
                panel=panel,
                blank=False,
            ),
        )


def body(view: Any) -> bytes:
    return canonical.dumps(view).encode()


def seen(situation: Trial, seq: int) -> bytes:
    return body(view_for(situation, translate(situation, LEXICON), PLACE, seq))


# Driver: own route, position, step and crowd agree; every other car, and who said what, may differ.


@dataclass(frozen=True)
class Drive:
    route: int
    position: int
    step: int
    crashed: bool
    heard: tuple[int, ...]

    def situation(self, hidden: Hidden) -> Trial:
        assert isinstance(MEDIUM, TrafficJunction)
        draw, own = hidden.draw, int(MEDIUM.routes[self.route][self.position])
        cars = int(draw.integers(max(len(self.heard), int(self.crashed)), 10))
        slots = draw.permutation(9)[:cars]
        route, position = np.zeros((1, 10), np.int32), np.zeros((1, 10), np.int32)
        alive = np.zeros((1, 10), np.bool_)
        alive[0, slots] = alive[0, 9] = True
        route[0, 9], position[0, 9] = self.route, self.position
        for index, slot in enumerate(slots):
            if self.crashed and index == 0:
                route[0, slot], position[0, slot] = self.route, self.position
            else:
                route[0, slot], position[0, slot] = self.elsewhere(draw, own)
        empty = MEDIUM.init(np.array([draw.integers(2**62)], np.uint64))
        world = replace(
            empty,
            alive=alive,
            route=route,
            position=position,
            age=draw.integers(0, 30, (1, 10)).astype(np.int32),
            t=np.full(1, 20 + self.step, np.int32),
            end=np.full(1, 60, np.int32),
        )
        begun = trial.begun(hidden.spec("driver", None), MEDIUM, world)
        return replace(
            begun,
            step=self.step,
            progress=self.position,
            outcome="collision" if self.crashed else None,
            said=silence(10) if self.crashed else self.said(draw, slots),
        )

    def elsewhere(self, draw: np.random.Generator, own: int) -> tuple[int, int]:
        """A route and a position of another car that is not in the participant's cell."""
        assert isinstance(MEDIUM, TrafficJunction)
        route = int(draw.integers(12))
        free = [i for i, cell in enumerate(MEDIUM.routes[route]) if cell != own]
        return route, int(draw.choice(free))

    def said(self, draw: np.random.Generator, slots: Any) -> Said:
        """The messages heard come from any cars; other cars keep their gates shut."""
        tokens, gates = [SILENT] * 10, [False] * 10
        for slot in slots:
            tokens[slot] = int(draw.integers(16))
        for slot, token in zip(draw.permutation(slots), draw.permutation(self.heard), strict=False):
            tokens[slot], gates[slot] = int(token), True
        tokens[9], gates[9] = int(draw.integers(16)), bool(draw.integers(2))
        return Said(tuple(tokens), tuple(gates))


@st.composite
def drives(draw: st.DrawFn) -> Drive:
    assert isinstance(MEDIUM, TrafficJunction)
    route = draw(st.integers(0, 11))
    position = draw(st.integers(0, int(MEDIUM.route_length[route]) - 1))
    heard = draw(st.lists(st.integers(0, 15), max_size=9))
    step = draw(st.integers(position, 39))
    return Drive(route, position, step, draw(st.booleans()), tuple(heard))


@PAIRS
@given(drives(), SEEDS, SEEDS)
def test_a_driver_learns_nothing_of_other_cars_but_what_was_heard(drive: Drive, one: int, two: int) -> None:
    left = drive.situation(Hidden(np.random.default_rng([1, one])))
    right = drive.situation(Hidden(np.random.default_rng([2, two])))
    assert left.spec.seed != right.spec.seed
    assert seen(left, drive.step) == seen(right, drive.step)


# Parent: own walk agrees, and the sign on screen; where the child is agrees only inside the vision square.


def panel(positions_of_token: list[int], numbers: list[int]) -> Panel:
    return Panel(
        bundle="parent_child/prototype-9",
        sha256="0" * 64,
        positions=POSITIONS,
        position_of_token=tuple(positions_of_token),
        number_at_position=tuple(n + 1 for n in numbers),
    )


@dataclass(frozen=True)
class Search:
    trail: tuple[int, ...]
    near: int | None
    """The child's cell, if it is in view."""
    place: int
    """Panel position of the sign."""
    numbers: int

    def situation(self, hidden: Hidden) -> Trial:
        assert isinstance(SEARCH, ParentChild)
        draw = hidden.draw
        order = draw.permutation(9).tolist()
        spec = hidden.spec("parent", panel(order, permutation(self.numbers, 1, 0, 9)))
        child = self.near if self.near is not None else int(draw.choice(self.far_cells()))
        seeds = np.array([draw.integers(2**62)], np.uint64)
        world = SEARCH.place(seeds, np.array([self.trail[-1]]), np.array([child]))
        said = Said((SILENT, order.index(self.place)), (False, True))
        begun = trial.spoken(trial.begun(spec, SEARCH, world), said)
        return replace(begun, trail=self.trail, step=len(self.trail) - 1)

    def far_cells(self) -> list[int]:
        row, col = divmod(self.trail[-1], 9)
        return [c for c in range(81) if max(abs(c // 9 - row), abs(c % 9 - col)) > 1]


@st.composite
def searches(draw: st.DrawFn) -> Search:
    row, col = draw(st.integers(0, 8)), draw(st.integers(0, 8))
    trail = [row * 9 + col]
    for move in draw(st.lists(st.sampled_from([(-1, 0), (0, 1), (1, 0), (0, -1)]), max_size=19)):
        row, col = min(8, max(0, row + move[0])), min(8, max(0, col + move[1]))
        trail.append(row * 9 + col)
    around = [
        r * 9 + c
        for r in range(max(0, row - 1), min(9, row + 2))
        for c in range(max(0, col - 1), min(9, col + 2))
        if (r, c) != (row, col)
    ]
    near = draw(st.none() | st.sampled_from(around))
    return Search(tuple(trail), near, draw(st.integers(0, 8)), draw(st.integers(0, 2**30)))


@PAIRS
@given(searches(), SEEDS, SEEDS)
def test_a_parent_learns_nothing_of_the_child_but_its_sign_and_what_is_near(
    search: Search, one: int, two: int
) -> None:
    left = search.situation(Hidden(np.random.default_rng([3, one])))
    right = search.situation(Hidden(np.random.default_rng([4, two])))
    assert seen(left, len(search.trail) - 1) == seen(right, len(search.trail) - 1)


# Child: own cell agrees, and the parent's where it is shown; the arm and what tokens mean do not.


@dataclass(frozen=True)
class Waiting:
    cell: int
    parent: int | None
    """None: the study does not show the parent."""
    numbers: int

    def situation(self, hidden: Hidden) -> Trial:
        assert isinstance(SEARCH, ParentChild)
        draw = hidden.draw
        signs = panel(draw.permutation(9).tolist(), permutation(self.numbers, 1, 0, 9))
        spec = hidden.spec("child", signs, sees_parent=self.parent is not None)
        anywhere = int(draw.choice([c for c in range(81) if c != self.cell]))
        parent = anywhere if self.parent is None else self.parent
        seeds = np.array([draw.integers(2**62)], np.uint64)
        world = SEARCH.place(seeds, np.array([parent]), np.array([self.cell]))
        return trial.spoken(trial.begun(spec, SEARCH, world), silence(2))


@st.composite
def waits(draw: st.DrawFn) -> Waiting:
    cell = draw(st.integers(0, 80))
    parent = draw(st.none() | st.integers(0, 80).map(lambda c: c if c != cell else (c + 1) % 81))
    return Waiting(cell, parent, draw(st.integers(0, 2**30)))


@PAIRS
@given(waits(), SEEDS, SEEDS)
def test_a_child_learns_nothing_of_what_its_signs_mean(wait: Waiting, one: int, two: int) -> None:
    left = wait.situation(Hidden(np.random.default_rng([5, one])))
    right = wait.situation(Hidden(np.random.default_rng([6, two])))
    assert seen(left, 0) == seen(right, 0)


def test_the_pairs_are_not_all_the_same_pair() -> None:
    """The leak tests can fail: something that may be seen does change the bytes."""
    drive = Drive(route=3, position=4, step=9, crashed=False, heard=(1, 2))
    hidden = Hidden(np.random.default_rng(0))
    assert seen(drive.situation(hidden), 9) != seen(replace(drive, position=5).situation(hidden), 9)
    search = Search((40, 41), None, 2, 5)
    assert seen(search.situation(hidden), 1) != seen(replace(search, near=42).situation(hidden), 1)
    assert seen(search.situation(hidden), 1) != seen(replace(search, place=3).situation(hidden), 1)
    wait = Waiting(10, 20, 5)
    assert seen(wait.situation(hidden), 0) != seen(replace(wait, parent=21).situation(hidden), 0)


def test_a_view_names_nothing_that_is_hidden() -> None:
    drive = Drive(route=3, position=4, step=9, crashed=False, heard=(1, 2))
    text = seen(drive.situation(Hidden(np.random.default_rng(0))), 9).decode()
    for word in ("seed", "arm", "bundle", "budget", "prototype", "one-hot", "sha256", "token", "gate"):
        assert word not in text


def test_a_collision_names_no_other_car() -> None:
    crash = Drive(route=0, position=6, step=6, crashed=True, heard=())
    view = view_for(crash.situation(Hidden(np.random.default_rng(1))), Heard(overlay=True), PLACE, 6)
    assert view["over"] == {"outcome": "collision", "steps": 6, "last": False}
    assert view["actions"] == []
    assert view["cell"] == view["route"][6]
    assert view["triangles"] == []


def test_triangles_go_out_as_row_column_and_likelihood() -> None:
    heard = Heard(2, 1, None, (Triangle(6, 3, 0.25),), overlay=True)
    drive = Drive(route=0, position=6, step=6, crashed=False, heard=())
    view = view_for(drive.situation(Hidden(np.random.default_rng(1))), heard, PLACE, 6)
    assert view["triangles"] == [[6, 3, 0.25]]


def test_the_lost_child_is_shown_when_the_round_is_over() -> None:
    search = Search((40, 41), None, 2, 5).situation(Hidden(np.random.default_rng(1)))
    over = replace(search, outcome="not_found")
    view = view_for(over, Heard(), PLACE, 1)
    row, col = divmod(int(SEARCH.cell_of(search.world)[0, 1]), 9)
    assert view["over"]["child"] == [row, col]
    assert view["child"] is None


def test_signs_are_listed_by_their_number_so_that_their_order_says_nothing_of_tokens() -> None:
    search = Search((40, 41), None, 2, 5).situation(Hidden(np.random.default_rng(1)))
    numbers = [sign["number"] for sign in view_for(search, Heard(), PLACE, 1)["signs"]]
    assert numbers == list(range(1, 10))


def test_a_car_looks_where_it_goes_next() -> None:
    route = [[0, 6], [1, 6], [1, 5]]
    assert heading(route, 0) == "down"
    assert heading(route, 1) == "left"
    assert heading(route, 2) == "left"
    assert heading(route, 3) == "left"


def test_roads_are_the_lanes_of_the_map() -> None:
    drive = Drive(route=0, position=0, step=0, crashed=False, heard=())
    assert roads(drive.situation(Hidden(np.random.default_rng(1)))) == {"rows": [6, 7], "columns": [6, 7]}
