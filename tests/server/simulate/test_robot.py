"""Robots walk the whole flow against the real application, also over a network that loses things."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from itsdangerous import TimestampSigner

from server.app import create_app
from server.domain import canonical
from server.domain.study import answer_key
from server.services.export import export
from server.services.lab import Lab
from server.services.verify import verify
from server.simulate import browser as browsers
from server.simulate.browser import Browser, RobotError
from server.simulate.crowd import USER_AGENT, Crowd, UnreachableError, quantile, robot, simulate, summary
from server.simulate.report import table
from server.simulate.robot import Result, Step
from server.storage import events, participants, trials
from server.storage.database import Database
from tests.fakes import definition, fake_lab
from tests.server.services.steps import launch

URL = "http://robots.test"
Transport = Callable[[httpx.AsyncBaseTransport], httpx.AsyncBaseTransport]


@pytest.fixture
def here(sqlite_database: Database) -> Lab:
    lab = fake_lab(sqlite_database)
    for slug in ("parent-child", "traffic-junction"):
        launch(lab, definition(slug, trials_per_block=2), mode="test")
    return lab


def walked(lab: Lab, crowd: Crowd, wrap: Transport = lambda inner: inner) -> list[Result]:
    """Let the robots walk one after the other, in this process."""

    async def walk() -> list[Result]:
        app = create_app(lab)
        results = []
        for index in range(crowd.participants):
            signature = TimestampSigner(lab.secret_key, salt="robot").sign(crowd.slug).decode()
            transport = wrap(httpx.ASGITransport(app))
            async with Browser(URL, transport, signature, USER_AGENT) as browser:
                results.append(await robot(crowd, index, browser).walk())
        return results

    return asyncio.run(walk())


@pytest.mark.parametrize("slug", ["parent-child", "traffic-junction"])
def test_a_robot_walks_a_whole_study_with_all_its_questions(sqlite_database: Database, slug: str) -> None:
    lab, study = fake_lab(sqlite_database), definition(slug, whole=True, trials_per_block=2)
    launch(lab, study, mode="test")
    [result] = walked(lab, Crowd(slug, 1, seed=3, url=URL, answers=answer_key(study)))
    assert result.error is None
    assert result.code == study.completion_code
    assert result.rounds == (6 if slug == "parent-child" else 3), "a round before a question counts once"
    assert verify(lab).clean


def stored(lab: Lab, key: str) -> list[Step]:
    with lab.database.reading() as db:
        person = participants.by_key(db, canonical.sha256(key))
        assert person is not None
        return [
            Step(trial.round, row.seq, canonical.loads(row.body)["action"])
            for trial in trials.of_participant(db, person.id)
            for row in events.of_trial(db, trial.id)[1:]
        ]


class LossyNetwork(httpx.AsyncBaseTransport):
    """Loses every fifth request on its way there, and every seventh answer on its way back."""

    def __init__(self, inner: httpx.AsyncBaseTransport) -> None:
        self.inner = inner
        self.count = 0

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        self.count += 1
        if self.count % 5 == 0:
            raise httpx.ConnectError("lost", request=request)
        response = await self.inner.handle_async_request(request)
        if self.count % 7 == 0:
            raise httpx.ReadError("lost", request=request)
        return response


@pytest.mark.parametrize("slug", ["parent-child", "traffic-junction"])
@pytest.mark.parametrize("style", ["sensible", "random"])
def test_a_robot_walks_from_the_link_to_the_code(here: Lab, slug: str, style: Any) -> None:
    [result] = walked(here, Crowd(slug, 1, seed=3, style=style))
    assert result.error is None
    assert result.finished
    assert result.rounds == (6 if slug == "parent-child" else 3)
    assert result.steps == stored(here, result.key)
    assert len(result.latencies_ms) == len(result.steps)


@pytest.mark.parametrize("slug", ["parent-child", "traffic-junction"])
def test_a_lossy_network_loses_and_doubles_nothing(
    here: Lab, slug: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(browsers, "PAUSE_FIRST_S", 0.0)
    monkeypatch.setattr(browsers, "PAUSE_MAX_S", 0.0)
    [result] = walked(here, Crowd(slug, 1, seed=3, style="random"), LossyNetwork)
    assert result.error is None
    assert result.retries > 5
    assert result.stale == 0
    assert result.steps == stored(here, result.key)
    with here.database.reading() as db:
        assert len(list(participants.stream(db))) == 1


def test_robots_are_of_mode_robot_and_never_in_a_plain_export(here: Lab, tmp_path: Path) -> None:
    results = walked(here, Crowd("parent-child", 2, seed=1))
    assert export(here, "parent-child", (), tmp_path / "live")["files"]["participants.csv"]["rows"] == 0
    found = export(here, "parent-child", ("robot",), tmp_path / "robots", practice=True)["files"]
    assert found["participants.csv"]["rows"] == 2
    assert found["trials.csv"]["rows"] == sum(result.rounds for result in results)
    assert found["steps.csv"]["rows"] == sum(len(result.steps) for result in results)


def test_a_stranger_cannot_be_a_robot(here: Lab) -> None:
    async def walk() -> Result:
        crowd = Crowd("parent-child", 1, seed=1)
        async with Browser(URL, httpx.ASGITransport(create_app(here)), "forged", USER_AGENT) as browser:
            return await robot(crowd, 0, browser).walk()

    result = asyncio.run(walk())
    assert not result.finished
    assert result.error is not None
    with here.database.reading() as db:
        assert list(participants.stream(db)) == []


def test_a_second_crowd_brings_new_people_and_the_same_crowd_comes_back(here: Lab) -> None:
    first = Crowd("traffic-junction", 1, seed=1)
    keys = {walked(here, crowd)[0].key for crowd in (first, first, Crowd("traffic-junction", 1, seed=1))}
    assert len(keys) == 2


def test_a_server_that_never_answers_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(browsers, "PATIENCE_S", 0.05)
    monkeypatch.setattr(browsers, "PAUSE_FIRST_S", 0.0)

    async def knock() -> None:
        transport = httpx.MockTransport(lambda _: httpx.Response(503))
        async with Browser(URL, transport, "", USER_AGENT) as browser:
            await browser.get("/s/demo")

    with pytest.raises(RobotError, match="GET /s/demo: no answer"):
        asyncio.run(knock())


@pytest.mark.parametrize("url", ["http://127.0.0.1:9", "http://127.0.0.1:99999", "ftp://here", "here"])
def test_no_server_is_said_in_one_line_that_helps(url: str) -> None:
    with pytest.raises(UnreachableError, match="start one with `hatlab serve`"):
        simulate(Crowd("parent-child", 1, seed=1, url=url), lambda: "")


def test_figures_add_up_over_robots() -> None:
    steps = [Step(1, 1, 0), Step(1, 2, 1)]
    good = Result(0, finished=True, rounds=2, successes=1, steps=steps, latencies_ms=[1.0, 3.0], retries=2)
    bad = Result(1, error="lost its way", rounds=1, steps=steps[:1], latencies_ms=[11.0])
    found = summary([good, bad])
    assert (found.participants, found.finished, found.rounds, found.successes) == (2, 1, 3, 1)
    assert (found.steps, found.retries, found.latency_median_ms, found.latency_p99_ms) == (3, 2, 3.0, 11.0)
    assert found.errors == ("robot 1: lost its way",)
    assert not found.complete
    assert summary([good]).complete


def test_the_table_names_what_the_issue_asks_for() -> None:
    crowd = Crowd("parent-child", 1, seed=1)
    shown = table(crowd, summary([Result(0, finished=True)]))
    names = list(shown.columns[0].cells)
    assert names[1:5] == ["finished", "rounds", "success", "steps"]
    assert "latency of a step, p99" in names


@pytest.mark.parametrize(("share", "value"), [(0.0, 1), (0.5, 2), (0.75, 3), (0.99, 4), (1.0, 4)])
def test_a_quantile_is_a_value_that_was_measured(share: float, value: int) -> None:
    assert quantile([1, 2, 3, 4], share) == value
