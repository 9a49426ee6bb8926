"""MTurk keeps the recruiters' contract: boto3 over real HTTP, with throttling and without.

Left out: who has begun or gave a place back is not listed, what is handed in cannot be returned, and nobody
is screened out with less than the reward.
"""

from collections.abc import Iterator
from dataclasses import replace

import httpx
import pytest

from server.recruitment.mturk_client import MTurkClient
from tests.server.recruitment.contract import POSTING, Marketplace, RecruiterContract
from tests.server.recruitment.mturk_people import FakeWorkers
from tests.server.recruitment.mturk_site import Site, mturk_site

THROTTLED = {"calm": 0, "busy": 10}  # every so many-th request is told to come again
NOTHING_MORE: frozenset[str] = frozenset()


@pytest.fixture(scope="module", params=sorted(THROTTLED))
def site(request: pytest.FixtureRequest) -> Iterator[Site]:
    with mturk_site(throttle_every=THROTTLED[request.param]) as served:
        yield served


@pytest.fixture(scope="module")
def client(site: Site) -> Iterator[MTurkClient]:
    made = site.client()
    yield made
    made.close()


@pytest.fixture
def people(site: Site) -> Iterator[FakeWorkers]:
    httpx.post(f"{site.url}/fake/reset").raise_for_status()
    made = FakeWorkers(site.url, site.market)
    yield made
    made.close()


@pytest.fixture
def marketplace(site: Site, client: MTurkClient, people: FakeWorkers) -> Marketplace:
    return Marketplace(site.recruiter(client), people, NOTHING_MORE, replace(POSTING, currency="USD"))


class TestMTurk(RecruiterContract):
    pass
