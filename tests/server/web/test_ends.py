"""What an end tells fits the way by which somebody came."""

import pytest

from server.recruitment.arrival import Arrival
from server.services.lab import Lab
from server.storage.database import Database
from server.web.ends import BACK, CLOSE, WITH_CODE, refused_page, way_back
from tests.fakes import definition, fake_lab
from tests.server.services.steps import launch
from tests.server.web.walk import client_of, come_in, go_on, mturk, prolific

SLUG = "traffic-junction"
CODES = {"screened_out": "SCREENED", "failed": "", "withdrawn": ""}


@pytest.fixture(name="lab")
def lab_with_a_study(sqlite_database: Database) -> Lab:
    lab = fake_lab(sqlite_database)
    launch(lab, definition(SLUG))
    return lab


@pytest.mark.parametrize(
    ("params", "says", "never"), [(prolific(), BACK, CLOSE), ({}, CLOSE, "return your place")]
)
def test_who_withdraws_is_sent_back_only_where_somebody_sent_them(
    lab: Lab, params: dict[str, str], says: str, never: str
) -> None:
    client = client_of(lab)
    address = come_in(client, SLUG, params)
    client.post(f"{address}/withdraw", data={"keep": "yes"})
    page = client.get(address).text
    assert says in page
    assert never not in page


@pytest.mark.parametrize("marketplace", ["direct", "list"])
def test_nobody_is_told_of_a_code_that_is_not_shown(marketplace: str) -> None:
    study = definition(SLUG, codes=CODES)
    page = refused_page(study, "screened_out", Arrival(marketplace), "phone")  # type: ignore[arg-type]
    assert page.code == ""
    assert WITH_CODE not in page.paragraphs
    assert CLOSE in page.paragraphs


def test_a_marketplace_gets_its_code() -> None:
    page = refused_page(definition(SLUG, codes=CODES), "screened_out", Arrival("prolific", "ada", "s1"))
    assert (page.code, way_back("prolific", True) in page.paragraphs) == ("SCREENED", True)


QUIZ = [{"key": "brake", "text": "Which key brakes?", "options": ["F", "J"], "answer": 1}]
PAY = {
    "currency": "USD",
    "reward_minor": 300,
    "partial_minor": 50,
    "screen_out_minor": 20,
    "cap_participant_minor": 400,
    "cap_study_minor": 10_000,
}


@pytest.mark.parametrize(
    ("params", "code", "pays"),
    [
        (prolific(), "SCREENED", "$0.20"),
        (mturk(), "SCREENED", "$3.00"),  # it has no screen-out: what is handed in is paid whole
        (mturk(), "", ""),
    ],
)
def test_who_fails_the_quiz_is_promised_what_the_marketplace_can_pay(
    sqlite_database: Database, params: dict[str, str], code: str, pays: str
) -> None:
    lab = fake_lab(sqlite_database)
    codes = CODES | {"screened_out": code}
    launch(lab, definition(SLUG, quiz=QUIZ, quiz_tries=1, practice_rounds=0, pay=PAY, codes=codes))
    client = client_of(lab)
    address = come_in(client, SLUG, params)
    go_on(client, address)
    client.post(f"{address}/answers", data={"form": "quiz:1", "attempt": "1", "a.brake": "2"})
    page = client.get(address).text
    assert "The study ends here for you" in page
    assert [amount for amount in ("$0.20", "$3.00") if amount in page] == ([pays] if pays else [])
    assert ("SCREENED" in page) == bool(code)


@pytest.mark.parametrize(("params", "pays"), [(prolific(), "$0.50"), (mturk(), "$3.00")])
def test_who_thinks_of_leaving_is_told_what_the_marketplace_can_pay(
    sqlite_database: Database, params: dict[str, str], pays: str
) -> None:
    lab = fake_lab(sqlite_database)
    launch(lab, definition(SLUG, pay=PAY, codes=CODES | {"withdrawn": "LEFT"}))
    client = client_of(lab)
    address = come_in(client, SLUG, params)
    assert f"You will get {pays} for your time" in client.get(f"{address}/withdraw").text
