"""What the pages of the whole journey hold for their scripts and for who has none: gate, forms, bar, ends."""

import json
import re
from typing import Any

import httpx
import pytest

from server.domain.participation import ENDS
from server.recruitment.arrival import Arrival
from server.services.lab import Lab
from server.web import ends
from server.web.pages import EndPage
from server.web.rendering import html
from tests.fakes import definition
from tests.server.services.steps import launch
from tests.server.web.client import Client
from tests.server.web.walk import client_of, come_in, go_on, mturk, play_block, prolific

QUESTION = {"key": "brake", "text": "Which key brakes?", "options": ["F", "J"], "answer": 1}
AGE = {"key": "age", "kind": "number", "text": "How old are you?", "minimum": 18, "maximum": 99}
EFFORT = {"key": "effort", "kind": "scale", "text": "Effort: How hard was it?", "low": "Low", "high": "High"}
PAY = {
    "reward_minor": 300,
    "bonus_success_minor": 10,
    "bonus_max_minor": 15,
    "cap_participant_minor": 400,
    "cap_study_minor": 10_000,
}


def data_of(page: httpx.Response, element: str) -> Any:
    found = re.search(rf'<script type="application/json" id="{element}">(.*?)</script>', page.text)
    assert found is not None
    return json.loads(found.group(1))


@pytest.fixture(name="client")
def client_of_a_study_with_everything(lab: Lab) -> Client:
    asked = {"key": "last", "title": "The last questions", "items": [AGE, EFFORT]}
    more = {"quiz": [QUESTION], "questionnaires": [asked], "pay": PAY}
    launch(lab, definition("traffic-junction", trials_per_block=2, practice_rounds=0, **more))
    return client_of(lab)


def answers(client: Client, address: str, form: str, **given: str) -> httpx.Response:
    fields = {f"a.{key}": value for key, value in given.items()}
    return client.post(f"{address}/answers", data={"form": form, "attempt": "1", **fields})


def test_the_entry_page_holds_what_a_device_must_show_and_works_without_a_script(client: Client) -> None:
    page = client.get("/s/traffic-junction", params=prolific())
    gate = data_of(page, "gate")
    assert (gate["width_min"], gate["height_min"], gate["keys"]) == (1024, 640, [["brake"], ["go"]])
    assert 'formaction="/s/traffic-junction/screened"' in page.text
    assert re.search(r'<section[^>]* id="check"[^>]* hidden>', page.text), "only a script opens it"


def test_telling_the_site_from_the_entry_page_screens_the_device_out(client: Client) -> None:
    fields = {**prolific(), "reason": "frames", "device": "", "browser": "", "viewport": ""}
    page = client.post("/s/traffic-junction/screened", data=fields)
    assert "draws pictures too slowly" in page.text
    assert 'href="https://app.prolific.com/submissions"' in page.text, "no code, so the way back is a link"


def test_the_play_page_holds_what_each_number_of_wins_is_worth(client: Client) -> None:
    address = come_in(client, "traffic-junction")
    assert go_on(client, address).text.count("<fieldset") == 1
    answers(client, address, "quiz:1", brake="1")
    data = data_of(client.get(address), "page-data")
    assert (data["page"], data["won"], data["bonuses"]) == ("play:1", 0, ["£0.00", "£0.10", "£0.15"])
    assert "2 rounds left" in client.get(address).text


def test_a_form_that_cannot_be_stored_comes_back_with_its_answers_and_a_word_at_each_wrong_one(
    client: Client,
) -> None:
    address = come_in(client, "traffic-junction")
    go_on(client, address)
    answers(client, address, "quiz:1", brake="1")
    play_block(client, address)
    page = client.get(address)
    assert page.text.count('name="a.effort"') == 21
    assert "checked" not in page.text, "nothing is chosen beforehand"
    assert "<b>Effort</b> How hard was it?" in page.text
    again = answers(client, address, "last:0", age="7", effort="35")
    assert again.status_code == 422
    assert "Please type a number from 18 to 99." in again.text
    assert 'value="7"' in again.text
    assert again.text.count("checked") == 1
    assert again.text.count("data-wrong") == 1
    assert answers(client, address, "last:0", age="42", effort="35").status_code == 303
    assert "£3.00" in client.get(address).text


@pytest.mark.parametrize("direction", ["ltr", "rtl"])
def test_pages_say_their_language_and_boards_are_never_mirrored(lab: Lab, direction: str) -> None:
    plain = definition("traffic-junction", trials_per_block=1)
    texts = {**plain.texts.model_dump(), "language": "ar", "direction": direction}
    launch(lab, definition("traffic-junction", trials_per_block=1, texts=texts))
    client = client_of(lab)
    address = come_in(client, "traffic-junction")
    for page in (client.get(address), go_on(client, address)):
        assert f'<html lang="ar" dir="{direction}">' in page.text
    assert '<main class="play" id="play" dir="ltr">' in client.get(address).text


@pytest.mark.parametrize(
    ("params", "way"),
    [
        (prolific(), "https://app.prolific.com/submissions"),
        (mturk(), "https://workersandbox.mturk.com"),
        ({**mturk(), "turkSubmitTo": "https://evil.example"}, "https://worker.mturk.com"),
        ({}, "/s/traffic-junction"),
    ],
)
def test_who_declines_has_a_way_on(client: Client, params: dict[str, str], way: str) -> None:
    page = client.post("/s/traffic-junction/consent", data={**params, "agree": "no"})
    assert f'class="button button-primary" href="{way}"' in page.text


def end_of(state: str, code: str) -> EndPage:
    elsewhere = None if code else ends.home("prolific", {})
    return EndPage(
        title="A study",
        state=state,
        icon="info",
        heading="How it ended",
        paragraphs=("What to do next.",),
        code=code,
        marketplace="prolific",
        url="https://app.prolific.com/submissions/complete?cc=CODE" if code else None,
        rounds_stored=2,
        rounds=2,
        paid=(),
        goes_by_itself=state in {"finished", "failed"},
        language="en",
        direction="ltr",
        elsewhere=elsewhere,
    )


@pytest.mark.parametrize("code", ["CODE", ""])
@pytest.mark.parametrize("state", ENDS)
def test_every_end_has_a_heading_a_next_step_and_a_way_on(state: str, code: str) -> None:
    text = bytes(html(end_of(state, code)).body).decode()
    assert "<h1>How it ended</h1>" in text
    assert "What to do next." in text
    assert text.count("button-primary") == 1
    assert ("data-by-itself" in text) == (state in {"finished", "failed"} and bool(code))


def test_an_unfit_device_of_somebody_whom_no_site_named_leads_back_to_the_study() -> None:
    study = definition("traffic-junction")
    page = ends.refused_page(study, "screened_out", Arrival("direct"), "phone")
    assert page.elsewhere == ends.again(study)
    assert page.code == ""


def test_who_missed_a_quiz_question_can_read_the_rules_again_beside_it(client: Client) -> None:
    address = come_in(client, "traffic-junction")
    go_on(client, address)
    first = client.get(address).text
    assert "Which key brakes?" in first
    assert "Brake with F, go with J" not in first
    answers(client, address, "quiz:1", brake="2")
    again = client.get(address).text
    assert "Please read once more below how to play" in again
    assert "<h2>Cross the junction" in again
    assert "Brake with F, go with J" in again
    assert again.count("<h1") == 1
