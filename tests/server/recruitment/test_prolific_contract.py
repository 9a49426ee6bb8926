"""Prolific keeps the recruiters' contract: over real HTTP, in good weather and in bad."""

from collections.abc import Iterator

import httpx
import pytest
from pydantic import SecretStr

from server.recruitment.prolific_api import ProlificRecruiter
from server.recruitment.prolific_http import Connection
from server.simulate.fake_prolific import FakeProlific, running
from server.simulate.fake_prolific_market import Market
from server.simulate.fake_prolific_weather import Weather
from tests.server.recruitment.contract import Marketplace, RecruiterContract
from tests.server.recruitment.prolific_people import FakePeople

TOKEN = "t0k3n-of-the-tests"


WEATHERS = {
    "calm": (Market(1), Weather(1)),
    "busy": (Market(2), Weather(2, limit_429=0.33)),  # every third request is told to come again
    "late": (Market(3, bonus_lag_s=3_600), Weather(3)),  # bonuses show an hour after they were paid
}


@pytest.fixture(scope="module", params=sorted(WEATHERS))
def url(request: pytest.FixtureRequest) -> Iterator[str]:
    with running(FakeProlific(TOKEN, *WEATHERS[request.param])) as served:
        yield served


@pytest.fixture(scope="module")
def connection(url: str) -> Iterator[Connection]:
    made = Connection(
        f"{url}/api/v1",
        SecretStr(TOKEN),
        transport=httpx.HTTPTransport(),
        sleep=lambda _: None,
        tries=40,
    )
    yield made
    made.close()


@pytest.fixture(scope="module")
def people(url: str) -> Iterator[FakePeople]:
    made = FakePeople(url)
    yield made
    made.close()


@pytest.fixture
def marketplace(connection: Connection, people: FakePeople) -> Marketplace:
    return Marketplace(ProlificRecruiter(connection, screen_out_minor=14), people)


class TestProlific(RecruiterContract):
    pass
