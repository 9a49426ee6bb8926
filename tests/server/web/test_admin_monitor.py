"""Live counts, the download, the agents."""

import csv
import io
import re
import zipfile
from dataclasses import replace

import pytest

from server.services import enrol, leave
from server.services.lab import Lab
from server.storage import participants
from server.storage.database import Database
from tests.fakes import fake_lab
from tests.server.services.steps import DESKTOP, come_in, prolific
from tests.server.web.admin_site import Experimenter, admin_app, with_account


@pytest.fixture
def site(sqlite_database: Database) -> Lab:
    return with_account(fake_lab(sqlite_database))


@pytest.fixture
def person(site: Lab) -> Experimenter:
    experimenter = Experimenter(site)
    experimenter.sign_in()
    return experimenter


def test_people_are_counted_by_kind_of_data(site: Lab, person: Experimenter) -> None:
    come_in(site, "parent-child", "ada")
    come_in(site, "parent-child", "grace")
    person.confirm("parent-child", "mode")
    come_in(site, "parent-child", "mary")
    page = person.get("/admin/studies/parent-child/monitor").text
    assert ">Live 1<" in page
    assert ">Test 2<" in page
    assert ">Robot 0<" in page
    assert "<dt>Playing now</dt><dd>1</dd>" in page
    assert (
        "<dt>Playing now</dt><dd>2</dd>" in person.get("/admin/studies/parent-child/monitor?mode=test").text
    )
    assert "Playing 1" in page
    assert "How to play, block 1" in page


def test_the_flow_is_drawn_with_everybody_in_it(site: Lab, person: Experimenter) -> None:
    come_in(site, "parent-child", "ada")
    key = come_in(site, "parent-child", "grace")
    with site.database.writing() as db:
        leave.withdraw(db, site, enrol.participant_by_key(db, site, key), keep=True)
        enrol.consent(db, site, "parent-child", prolific("eve"), agree=False, device=DESKTOP)
        enrol.screen_out(db, site, "parent-child", prolific("phone"))
    page = " ".join(person.get("/admin/studies/parent-child/monitor?mode=test&show=left").text.split())
    flow = page[page.index('class="consort"') : page.index("Over all versions")]
    numbers = re.findall(r'class="node"><span>([^<]+)</span> <b class="tnum">(\d+)</b>', flow)
    assert numbers == [
        ("Known to have opened the link", "4"),
        ("Consented, and allocated to an arm", "2"),
        ("Went through everything", "0"),
        ("Analysed", "0"),
    ]
    for lost in ("1</span> declined", "1</span> device did not fit", "1</span> withdrew", "1</span> still"):
        assert lost in flow
    assert "timed out" not in flow
    assert "<dt>Did not enter</dt><dd>2 " in page
    assert "<span>Withdrew</span>" in page
    assert "Left 1<" in page
    only_live = person.get("/admin/studies/parent-child/monitor?mode=live").text
    assert "still taking part" not in only_live


def test_everybody_at_an_end_has_words_on_the_page(site: Lab, person: Experimenter) -> None:
    names = {
        "withdrawn": "Withdrew",
        "timed_out": "Timed out",
        "returned": "Returned",
        "rejected": "Rejected there",
        "failed": "Attention",
        "screened_out": "Quiz",
        "finished": "Finished",
    }
    for number, status in enumerate(names):
        key = come_in(site, "traffic-junction", f"p{number}")
        with site.database.writing() as db:
            who = enrol.participant_by_key(db, site, key)
            participants.end(db, who.id, status, who.page, None, None, site.now_utc())
    pages = "".join(
        person.get(f"/admin/studies/traffic-junction/monitor?mode=test&show={show}").text
        for show in ("finished", "left", "excluded")
    )
    for word in names.values():
        assert f"<span>{word}</span>" in pages


def test_the_monitor_of_a_draft_says_that_nobody_can_be_there(person: Experimenter) -> None:
    person.post("/admin/studies/new", source="template:parent-child", title="Later")
    page = person.get("/admin/studies/later/monitor").text
    assert "was not launched yet" in page
    assert "export.zip" not in page


def test_wrong_choices_in_the_address_fall_back(person: Experimenter) -> None:
    page = person.get("/admin/studies/parent-child/monitor?mode=%3Cb%3E&show=nonsense")
    assert page.status_code == 200
    assert "<b>" not in page.text.replace("<b>This", "")


def test_the_list_counts_and_filters(site: Lab, person: Experimenter) -> None:
    come_in(site, "traffic-junction", "ada")
    person.post("/admin/studies/traffic-junction/pause")
    page = person.get("/admin").text
    assert "Paused 1" in page
    assert "<dt>Playing now</dt><dd>1</dd>" in page
    assert "0 / 126" in page
    only = person.get("/admin?show=paused").text
    assert "Cross the junction" in only
    assert "Find the lost child" not in only


def test_the_download_is_a_zip_of_the_kinds_that_were_asked_for(site: Lab, person: Experimenter) -> None:
    come_in(site, "parent-child", "ada")
    answer = person.get("/admin/studies/parent-child/export.zip?mode=test")
    assert answer.headers["content-type"] == "application/zip"
    assert answer.headers["cache-control"] == "no-store"
    assert 'filename="hatlab-parent-child-test-20261124-12' in answer.headers["content-disposition"]
    assert len(people_in(answer.content)) == 1
    for query in ("", "?mode=live", "?mode=live&mode=robot"):
        assert people_in(person.get(f"/admin/studies/parent-child/export.zip{query}").content) == []


def people_in(content: bytes) -> list[dict[str, str]]:
    with zipfile.ZipFile(io.BytesIO(content)) as files:
        assert files.testzip() is None
        text = files.read(next(name for name in files.namelist() if name.endswith("participants.csv")))
    return list(csv.DictReader(io.StringIO(text.decode("utf-8-sig"))))


def test_an_unknown_kind_of_data_is_refused_before_the_download_begins(person: Experimenter) -> None:
    assert person.get("/admin/studies/parent-child/export.zip?mode=everything").status_code == 422


def test_agents_are_listed_with_what_a_study_must_know(person: Experimenter, site: Lab) -> None:
    page = person.get("/admin/agents").text
    for name, bundle in site.bundles.items():
        assert f'href="/admin/agents/{name}"' in page
        assert bundle.sha256 in page
    card = person.get("/admin/agents/traffic_junction/budget-030")
    assert card.status_code == 200
    assert "Message budget</dt><dd>0.3</dd>" in card.text
    assert card.text.count('class="map"') == 16
    assert person.get("/admin/agents/traffic_junction/gone").status_code == 404


def test_an_agent_that_could_not_be_loaded_is_named_with_its_reason(site: Lab) -> None:
    left = {name: bundle for name, bundle in site.bundles.items() if "onehot" not in name}
    broken = replace(
        site, bundles=left, bundle_errors=("parent_child/onehot-9/weights.safetensors: changed",)
    )
    person = Experimenter(broken, admin_app(broken))
    person.sign_in()
    assert "weights.safetensors: changed" in person.get("/admin/agents").text
    assert "1 agent could not be loaded" in person.get("/admin").text
    monitor = person.get("/admin/studies/parent-child/monitor").text
    assert "This study cannot be played:" in monitor
    assert "parent_child/onehot-9 is not loaded" in " ".join(monitor.split())
    assert "onehot-9 (not loaded)" in person.get("/admin/studies/parent-child").text
