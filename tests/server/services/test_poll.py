"""Asking about every posting: one line each, and one marketplace that fails keeps nobody from the next."""

from collections.abc import Iterator
from dataclasses import replace

import pytest
from pydantic import SecretStr

from server.domain.errors import NotFoundError
from server.services import poll
from server.services.lab import Lab
from server.simulate.fake_prolific import FakeProlific, running
from server.simulate.fake_prolific_market import Market
from server.simulate.fake_prolific_weather import Weather
from server.storage import postings, studies
from server.storage.database import Database
from tests.fakes import fake_lab
from tests.server.recruitment.prolific_people import FakePeople
from tests.server.services.steps import person
from tests.server.services.test_reconcile import SLUG, TOKEN, Site, site_at


@pytest.fixture
def site(sqlite_database: Database) -> Iterator[Site]:
    with running(FakeProlific(TOKEN, Market(1), Weather(1))) as url:
        people = FakePeople(url)
        yield site_at(url, people, sqlite_database)
        people.close()


def lines(lab: Lab, slug: str | None = None) -> list[str]:
    return [each.text for each in poll.poll(lab, slug)]


def test_what_the_marketplaces_tell_of_live_studies_is_taken_in(site: Site) -> None:
    taken, key = site.arrive()
    site.people.give_back(taken)
    assert lines(site.lab) == [f"{SLUG}  Prolific {site.external_id}: 1 submission"]
    assert person(site.lab, key).status == "returned"


def test_a_study_in_test_mode_is_asked_about_only_by_its_name(site: Site) -> None:
    with site.lab.database.writing() as db:
        studies.set_mode(db, studies.every(db)[0].id, "test")
    assert lines(site.lab) == []
    assert len(lines(site.lab, SLUG)) == 1
    with pytest.raises(NotFoundError):
        lines(site.lab, "no-such-study")


def test_a_marketplace_that_cannot_be_asked_does_not_keep_the_others_from_it(site: Site) -> None:
    with site.lab.database.writing() as db:
        study_id = postings.of_study(db, 1)[0].study_id
        postings.add(db, study_id, "mturk", "TYPE:QUAL", "active", 2, "{}", site.lab.now_utc())
    asked = list(poll.poll(site.lab, None))
    assert [each.submissions for each in asked] == [0, None]
    assert "no account at Mechanical Turk" in asked[1].text


def test_a_setting_that_cannot_be_used_is_said_and_is_no_fault_of_the_servers(site: Site) -> None:
    broken = site.lab.settings.model_copy(update={"prolific_api": "http://elsewhere.example/api"})
    (asked,) = poll.poll(replace(site.lab, settings=broken), None)
    assert "must begin with https" in asked.text
    wrong = site.lab.settings.model_copy(update={"prolific_token": SecretStr("another key")})
    (refused,) = poll.poll(replace(site.lab, settings=wrong), None)
    assert refused.submissions is None
    assert "another key" not in refused.text


def test_a_lab_without_postings_has_nothing_to_ask(sqlite_database: Database) -> None:
    assert lines(fake_lab(sqlite_database)) == []
