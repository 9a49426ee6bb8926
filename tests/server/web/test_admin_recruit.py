"""The recruitment page, from a draft at the marketplace to the last payment, as an experimenter uses it."""

from collections.abc import Iterator
from dataclasses import replace

import pytest
from pydantic import SecretStr

from server.services import recruit
from server.services.lab import Lab
from server.simulate.fake_prolific import FakeProlific, running
from server.storage import postings, studies
from server.storage.database import Database
from tests.fakes import definition, fake_lab
from tests.server.recruitment.prolific_people import FakePeople
from tests.server.services.steps import launch, play_all
from tests.server.services.test_reconcile import CODES, PAY
from tests.server.web.admin_site import Experimenter, with_account
from tests.server.web.walk import client_of, come_in

TOKEN = "t0k3n-of-the-tests"
SLUG = "traffic-junction"
URL = f"/admin/studies/{SLUG}/recruitment"


@pytest.fixture
def fake() -> Iterator[str]:
    with running(FakeProlific(TOKEN)) as url:
        yield url


@pytest.fixture
def site(fake: str, sqlite_database: Database) -> Lab:
    lab = fake_lab(sqlite_database)
    changes = {"prolific_api": f"{fake}/api/v1", "prolific_token": SecretStr(TOKEN)}
    lab = replace(lab, settings=lab.settings.model_copy(update=changes))
    launch(lab, definition(SLUG, trials_per_block=1, pay=PAY, codes=CODES))
    return with_account(lab)


@pytest.fixture
def person(site: Lab) -> Experimenter:
    experimenter = Experimenter(site)
    experimenter.sign_in()
    return experimenter


def posting(lab: Lab) -> postings.PostingRow:
    with lab.database.reading() as db:
        study = studies.by_slug(db, SLUG)
        assert study is not None
        (row,) = postings.of_study(db, study.id)
        return row


def publish(lab: Lab, person: Experimenter) -> postings.PostingRow:
    made = person.post(URL, marketplace="prolific", places="3", description="Drive a car.")
    assert made.status_code == 303, made.text
    row = posting(lab)
    asked = person.get(f"{URL}/{row.id}/publish").text
    assert "3 places" in asked
    assert "£3.00" in asked
    assert person.confirm(SLUG, f"recruitment/{row.id}/publish").status_code == 303
    return posting(lab)


def test_a_study_is_offered_published_and_paid(site: Lab, person: Experimenter, fake: str) -> None:
    row = publish(site, person)
    assert row.state == "active"
    people = FakePeople(fake)
    taken = people.take(row.external_id)
    client = client_of(site)
    params = dict(pair.split("=") for pair in taken.entry_url.partition("?")[2].split("&"))
    key = come_in(client, SLUG, params).rsplit("/", 1)[1]
    play_all(site, key)
    people.hand_in(taken, "CROSSED-OVER")
    person.post(f"{URL}/{row.id}/poll")
    page = person.get(URL).text
    assert "Approve and pay" in page
    name = f"do.approve:{taken.submission_id}"
    assert f'name="{name}"' in page
    review = person.post(f"{URL}/{row.id}/review", **{name: "1"}).text
    assert "£3.00" in review
    assert people.rewards(taken) == 0
    done = person.post(f"{URL}/{row.id}/confirm", **{name: "1"}).text
    assert "1 done" in done
    assert people.rewards(taken) == 1
    person.post(f"{URL}/{row.id}/confirm", **{name: "1"})
    assert people.rewards(taken) == 1
    people.close()


def test_the_token_is_nowhere_on_the_page(site: Lab, person: Experimenter) -> None:
    publish(site, person)
    assert TOKEN not in person.get(URL).text


def test_what_the_marketplace_refuses_is_said_on_the_page(site: Lab, person: Experimenter, fake: str) -> None:
    people = FakePeople(fake)
    people.plan_fault(match="POST /api/v1/studies", status=400)
    answer = person.post(URL, marketplace="prolific", places="3", description="Drive a car.")
    assert answer.status_code == 502
    assert 'role="alert"' in answer.text
    assert "Drive a car." in answer.text
    people.close()
    assert recruit.MarketplaceError.status == 502
    assert site is not None


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"marketplace": "prolific", "places": "0"}, "a number from 1 to"),
        ({"marketplace": "prolific", "places": "many"}, "a number from 1 to"),
        ({"marketplace": "elsewhere", "places": "3"}, "Choose a marketplace"),
    ],
)
def test_wrong_input_is_named_and_nothing_is_made(
    site: Lab, person: Experimenter, fields: dict[str, str], says: str
) -> None:
    answer = person.post(URL, **fields)
    assert answer.status_code == 422
    assert says in answer.text
    with site.database.reading() as db:
        study = studies.by_slug(db, SLUG)
        assert study is not None
        assert postings.of_study(db, study.id) == []


def test_nobody_without_login_reaches_recruitment(site: Lab) -> None:
    stranger = Experimenter(site)
    assert stranger.get(URL).status_code == 303
    assert stranger.client.post(f"{URL}/1/confirm", data={"do.approve:x": "1"}).status_code in {303, 403}


def test_a_posting_is_reached_only_by_the_address_of_its_own_study(site: Lab, person: Experimenter) -> None:
    row = publish(site, person)
    other = "/admin/studies/parent-child/recruitment"
    assert person.get(other).status_code == 200
    assert person.get(f"{URL}/{row.id}/publish").status_code == 200
    assert person.get(f"{other}/{row.id}/publish").status_code == 404
    assert person.post(f"{other}/{row.id}/pause").status_code == 404
    assert posting(site).state == row.state
    assert 400 <= person.get(f"{URL}/{10**20}/publish").status_code < 500


def test_opening_the_page_of_differences_pays_nobody_and_rejects_nobody(
    site: Lab, person: Experimenter, fake: str
) -> None:
    row = publish(site, person)
    people = FakePeople(fake)
    stranger = people.take(row.external_id)
    people.hand_in(stranger, "A-GUESS")
    person.post(f"{URL}/{row.id}/poll")
    for _ in range(3):
        assert "handed in there, but never started here" in person.get(URL).text
    assert people.ledger()["payments"] == []
    with site.database.reading() as db:
        assert postings.ledger(db, row.study_id) == []
        assert [each.state for each in postings.submissions(db, row.id)] == ["awaiting_review"]
    people.close()
