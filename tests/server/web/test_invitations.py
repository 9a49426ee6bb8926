"""Personal links over HTTP: the same person anywhere, a clear page for a link that nobody sent."""

from typing import Any

import pytest

from server.recruitment import personal
from server.services.lab import Lab
from server.storage import enrolments
from tests.fakes import definition
from tests.server.services.steps import launch, person
from tests.server.web.walk import YES, client_of, come_in, go_on, hidden_fields

SLUG = "parent-child"


def invited(lab: Lab, name: str = "Ada") -> dict[str, str]:
    return {"invite": personal.code_of(name, SLUG, lab.secret_key)}


def test_a_personal_link_is_the_same_session_in_any_browser(lab: Lab) -> None:
    launch(lab, definition(SLUG))
    at_home, at_work = client_of(lab), client_of(lab)
    address = come_in(at_home, SLUG, invited(lab))
    go_on(at_home, address)
    again = at_work.get(f"/s/{SLUG}", params=invited(lab))
    assert (again.status_code, again.headers["location"]) == (303, address)
    assert come_in(at_work, SLUG, invited(lab, "Bob")) != address
    assert not at_home.cookies
    row = person(lab, address.rpartition("/")[2])
    with lab.database.reading() as db:
        who = enrolments.identity_of(db, row.id)
    assert (row.marketplace, who.marketplace, who.external_id) == ("list", "list", "Ada")


@pytest.mark.parametrize("code", ["Ada", "", "x" * 600, "QWRh.made-up", "line\nbreak"])
def test_a_made_up_link_is_refused_with_a_page_that_says_so(lab: Lab, code: str) -> None:
    launch(lab, definition(SLUG))
    client = client_of(lab)
    page = client.get(f"/s/{SLUG}", params={"invite": code})
    assert page.status_code == 403
    assert "This invitation is not valid" in page.text
    assert "consent" not in page.text.lower()
    refused = client.post(f"/s/{SLUG}/consent", data={"invite": code, **YES})
    assert refused.status_code == 403
    assert "/p/" not in refused.headers.get("location", "")


def test_a_link_for_another_study_does_not_open_this_one(lab: Lab) -> None:
    launch(lab, definition(SLUG))
    launch(lab, definition("traffic-junction"))
    assert client_of(lab).get("/s/traffic-junction", params=invited(lab)).status_code == 403


def test_somebody_who_forgot_the_tick_is_still_who_they_are(lab: Lab) -> None:
    launch(lab, definition(SLUG))
    client = client_of(lab)
    entry = client.get(f"/s/{SLUG}", params=invited(lab))
    forgotten: dict[str, Any] = {**hidden_fields(entry.text), "agree": "yes"}
    again = client.post(f"/s/{SLUG}/consent", data=forgotten)
    assert again.status_code == 422
    assert hidden_fields(again.text)["invite"] == invited(lab)["invite"]


def test_who_declines_a_personal_link_is_told_as_somebody_who_was_named(lab: Lab) -> None:
    launch(lab, definition(SLUG, codes={"screened_out": "NO-DEVICE", "failed": "", "withdrawn": ""}))
    client = client_of(lab)
    screened = client.post(f"/s/{SLUG}/screened", data={**invited(lab), "reason": "phone"})
    assert "NO-DEVICE" in screened.text
    assert "NO-DEVICE" in client.get(f"/s/{SLUG}", params=invited(lab)).text
    nobody = client.post(f"/s/{SLUG}/screened", data={"reason": "phone"})
    assert "NO-DEVICE" not in nobody.text
