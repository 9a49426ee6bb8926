"""Every state in which somebody can open an entry link, and what consent leaves behind."""

from dataclasses import replace
from typing import Any

import pytest

from server.services.lab import Lab
from server.storage import enrolments, participants, studies
from server.storage.database import Database
from tests.fakes import definition, fake_lab
from tests.server.services.steps import launch
from tests.server.web.client import Client
from tests.server.web.walk import DEVICE, YES, client_of, come_in, hidden_fields, mturk, play_all, prolific

SLUG = "traffic-junction"


@pytest.fixture(name="lab")
def quick_lab(sqlite_database: Database) -> Lab:
    return fake_lab(sqlite_database)


def open_study(lab: Lab, **changes: Any) -> Client:
    status = changes.pop("status", "open")
    launch(lab, definition(SLUG, **changes), status=status)
    return client_of(lab)


def people(lab: Lab) -> int:
    with lab.database.reading() as db:
        return len(list(participants.stream(db)))


def test_the_consent_page_says_what_the_study_says_and_keeps_the_identifiers(lab: Lab) -> None:
    page = open_study(lab).get(f"/s/{SLUG}", params=prolific())
    assert page.status_code == 200
    assert "about 20 minutes" in page.text
    assert "Cross the junction" in page.text
    assert hidden_fields(page.text).items() >= prolific().items()
    assert people(lab) == 0


@pytest.mark.parametrize("slug", ["nobody", "NOBODY", "a%00b", "%2e%2e", "x" * 500])
def test_an_unknown_study_says_what_to_do(lab: Lab, slug: str) -> None:
    client = client_of(lab)
    for response in (client.get(f"/s/{slug}"), client.post(f"/s/{slug}/consent", data=YES)):
        assert response.status_code == 404
        assert "from your invitation" in response.text


def test_a_draft_is_nobodys_business(lab: Lab) -> None:
    with lab.database.writing() as db:
        studies.add(db, SLUG, "t", "test", definition(SLUG).canonical, lab.now_utc())
    assert client_of(lab).get(f"/s/{SLUG}").status_code == 404


@pytest.mark.parametrize(("status", "said"), [("paused", "paused"), ("closed", "has ended")])
def test_a_study_that_takes_nobody_says_so_and_stores_nothing(lab: Lab, status: str, said: str) -> None:
    client = open_study(lab, status=status)
    for response in (
        client.get(f"/s/{SLUG}", params=prolific()),
        client.post(f"/s/{SLUG}/consent", data={**prolific(), **YES}),
    ):
        assert said in response.text
        assert response.status_code == 200
    assert people(lab) == 0


def test_nobody_is_let_into_a_study_whose_agents_are_not_all_there(lab: Lab) -> None:
    launch(lab, definition(SLUG))
    agents = {name: agent for name, agent in lab.bundles.items() if name != "traffic_junction/budget-030"}
    client = client_of(replace(lab, bundles=agents))
    assert "paused" in client.get(f"/s/{SLUG}", params=prolific()).text
    assert "paused" in client.post(f"/s/{SLUG}/consent", data={**prolific(), **YES}).text
    assert people(lab) == 0


def test_a_full_study_says_so(lab: Lab) -> None:
    arms = [{"name": "one", "bundle": "traffic_junction/budget-100", "places": 1}]
    client = open_study(lab, arms=arms)
    come_in(client, SLUG)
    assert "All places are taken" in client.get(f"/s/{SLUG}", params=prolific("bob")).text
    late = client.post(f"/s/{SLUG}/consent", data={**prolific("bob"), **YES})
    assert "All places are taken" in late.text
    assert people(lab) == 1


def test_a_preview_shows_the_study_to_nobody_and_stores_nothing(lab: Lab) -> None:
    client = open_study(lab)
    hit = mturk(assignment="ASSIGNMENT_ID_NOT_AVAILABLE")
    page = client.get(f"/s/{SLUG}", params=hit)
    assert "This is a preview" in page.text
    assert "frame-ancestors https://worker.mturk.com" in page.headers["content-security-policy"]
    client.post(f"/s/{SLUG}/consent", data={**hit, **YES})
    assert people(lab) == 0


def test_declining_leaves_no_person_and_says_what_is_kept(lab: Lab) -> None:
    client = open_study(lab)
    page = client.post(f"/s/{SLUG}/consent", data={**prolific(), **DEVICE, "agree": "no"})
    assert "scrambled form" in page.text
    assert "nothing else about you is kept" in page.text
    assert people(lab) == 0
    assert not client.cookies


@pytest.mark.parametrize("fields", [{"agree": "yes"}, {"read": "yes"}, {"agree": "maybe", "read": "yes"}, {}])
def test_without_the_tick_the_page_comes_back_and_says_why(lab: Lab, fields: dict[str, str]) -> None:
    client = open_study(lab)
    page = client.post(f"/s/{SLUG}/consent", data={**prolific(), **fields})
    assert page.status_code == 422
    assert "tick the box" in page.text
    assert hidden_fields(page.text).items() >= prolific().items()
    assert people(lab) == 0


def test_the_tick_that_was_missed_does_not_change_the_name_of_a_direct_visit(lab: Lab) -> None:
    client = open_study(lab)
    first = hidden_fields(client.get(f"/s/{SLUG}").text)
    again = client.post(f"/s/{SLUG}/consent", data={**first, "agree": "yes"})
    assert hidden_fields(again.text)["visit"] == first["visit"]


def test_the_same_person_comes_back_to_the_same_session(lab: Lab) -> None:
    client = open_study(lab)
    address = come_in(client, SLUG)
    again = client.get(f"/s/{SLUG}", params=prolific())
    assert (again.status_code, again.headers["location"]) == (303, address)
    twice = client.post(f"/s/{SLUG}/consent", data={**prolific(), **YES})
    assert twice.headers["location"] == address
    assert people(lab) == 1
    assert not client.cookies


def test_a_session_goes_on_after_the_study_was_closed(lab: Lab) -> None:
    client = open_study(lab)
    address = come_in(client, SLUG)
    with lab.database.writing() as db:
        study = studies.by_slug(db, SLUG)
        assert study is not None
        studies.set_status(db, study.id, "closed")
    assert client.get(f"/s/{SLUG}", params=prolific()).headers["location"] == address
    assert client.get(address).status_code == 200


def test_a_cookie_brings_the_browser_of_a_direct_link_back(lab: Lab) -> None:
    client = open_study(lab)
    address = come_in(client, SLUG, {})
    again = client.get(f"/s/{SLUG}")
    assert (again.status_code, again.headers["location"]) == (303, address)
    assert client_of(lab).get(f"/s/{SLUG}").status_code == 200
    assert client.get(f"/s/{SLUG}", params=prolific()).status_code == 200


def test_a_direct_form_sent_twice_is_one_person(lab: Lab) -> None:
    client = open_study(lab)
    fields = {**hidden_fields(client.get(f"/s/{SLUG}").text), **YES}
    first, second = (client_of(lab).post(f"/s/{SLUG}/consent", data=fields) for _ in range(2))
    assert first.headers["location"] == second.headers["location"]
    assert people(lab) == 1


@pytest.mark.parametrize(("url", "secure"), [("http://hatlab.test", False), ("https://hatlab.test", True)])
def test_the_cookie_is_kept_from_scripts_and_other_sites(lab: Lab, url: str, secure: bool) -> None:
    launch(lab, definition(SLUG))
    client = client_of(lab, base_url=url)
    fields = hidden_fields(client.get(f"/s/{SLUG}").text)
    cookie = client.post(f"/s/{SLUG}/consent", data={**fields, **YES}).headers["set-cookie"]
    assert cookie.startswith(f"hatlab-{SLUG}=")
    parts = {part.strip().lower() for part in cookie.split(";")[1:]}
    assert {"httponly", "samesite=lax", f"path=/s/{SLUG}"} <= parts
    assert ("secure" in parts) == secure


def test_a_cookie_that_names_nobody_is_ignored(lab: Lab) -> None:
    client = open_study(lab)
    client.cookies.set(f"hatlab-{SLUG}", "x" * 43)
    assert "Before you start" in client.get(f"/s/{SLUG}").text


def test_a_robot_needs_the_servers_signature(lab: Lab) -> None:
    client = open_study(lab)
    headers = {"X-Hatlab-Robot": "traffic-junction.forged.forged"}
    refused = client.get(f"/s/{SLUG}", params=prolific(), headers=headers)
    assert refused.status_code == 422
    late = client.post(f"/s/{SLUG}/consent", data={**prolific(), **YES}, headers=headers)
    assert late.status_code == 422
    assert people(lab) == 0


def launch_again(lab: Lab, **changes: Any) -> None:
    """Another version, while somebody has the consent page of the first one open."""
    newer = definition(SLUG, **changes)
    with lab.database.writing() as db:
        row = studies.by_slug(db, SLUG)
        assert row is not None
        studies.add_version(db, row.id, newer.canonical, newer.sha256, lab.now_utc())


def test_nobody_agrees_to_a_text_that_was_changed_while_it_was_read(lab: Lab) -> None:
    client = open_study(lab)
    first = hidden_fields(client.get(f"/s/{SLUG}", params=prolific()).text)
    texts = definition(SLUG).model_dump(mode="json")["texts"]
    launch_again(lab, texts={**texts, "consent": ["Risk: something else now."]})
    again = client.post(f"/s/{SLUG}/consent", data={**first, **YES})
    assert again.status_code == 422
    assert "was changed while you had it open" in again.text
    assert "Something else now." in again.text
    assert people(lab) == 0
    second = hidden_fields(again.text)
    assert second.items() >= prolific().items()
    assert client.post(f"/s/{SLUG}/consent", data={**second, **YES}).status_code == 303
    with lab.database.reading() as db:
        (row,) = participants.stream(db)
        agreed = enrolments.consent_of(db, row.id)
    assert agreed.text_sha256 == second["consent_text"] != first["consent_text"]


def test_a_new_version_with_the_same_text_troubles_nobody(lab: Lab) -> None:
    client = open_study(lab)
    first = hidden_fields(client.get(f"/s/{SLUG}").text)
    launch_again(lab, duration_min=33)
    assert client.post(f"/s/{SLUG}/consent", data={**first, **YES}).status_code == 303


def test_a_missing_tick_after_a_change_of_the_text_shows_the_new_one_with_its_hash(lab: Lab) -> None:
    client = open_study(lab)
    first = hidden_fields(client.get(f"/s/{SLUG}").text)
    texts = definition(SLUG).model_dump(mode="json")["texts"]
    launch_again(lab, texts={**texts, "consent": ["Risk: something else now."]})
    unticked = hidden_fields(client.post(f"/s/{SLUG}/consent", data={**first, "agree": "yes"}).text)
    assert unticked["visit"] == first["visit"]
    assert unticked["consent_text"] != first["consent_text"]


def multipart(charset: str, **fields: bytes) -> dict[str, Any]:
    parts = [
        b'--b\r\nContent-Disposition: form-data; name="%s"\r\n\r\n%s\r\n' % (n.encode(), v)
        for n, v in fields.items()
    ]
    kind = f"multipart/form-data; boundary=b; charset={charset}"
    return {"content": b"".join((*parts, b"--b--\r\n")), "headers": {"content-type": kind}}


@pytest.mark.parametrize("charset", ["unicode_escape", "raw_unicode_escape", "undefined", "punycode"])
def test_a_charset_that_makes_no_text_is_refused_and_is_no_incident(lab: Lab, charset: str) -> None:
    fields = {**prolific(), "agree": "yes", "read": "yes", "browser": "\\ud800 x"}
    sent = multipart(charset, **{name: value.encode() for name, value in fields.items()})
    refused = open_study(lab).post(f"/s/{SLUG}/consent", **sent)
    assert refused.status_code == 400
    assert "Incident" not in refused.text
    assert people(lab) == 0


def test_a_null_character_in_a_form_is_refused_for_postgresql_cannot_store_it(lab: Lab) -> None:
    client = open_study(lab)
    assert client.post("/admin/login", data={"username": "a\0b", "password": "x"}).status_code == 400


def test_who_took_the_task_again_submits_the_new_assignment(lab: Lab) -> None:
    client = open_study(lab, trials_per_block=1)
    address = come_in(client, SLUG, mturk(assignment="returned"))
    again = client.get(f"/s/{SLUG}", params=mturk(assignment="taken-again"))
    assert again.headers["location"] == address
    assert hidden_fields(play_all(client, address).text)["assignmentId"] == "taken-again"
    client.get(f"/s/{SLUG}", params=mturk(assignment="a-third"))
    assert hidden_fields(client.get(address).text)["assignmentId"] == "taken-again"
    assert people(lab) == 1
