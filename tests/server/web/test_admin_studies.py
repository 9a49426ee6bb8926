"""Making, changing, launching studies through the pages."""

import hashlib
import json
import re
import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from server.domain import canonical
from server.domain.study import read
from server.services import studies
from server.services.lab import Lab
from server.services.studies import Study
from server.storage import studies as rows
from server.storage.database import Database
from tests.fakes import fake_lab
from tests.server.web.admin_site import Experimenter, fields_of, with_account

BUDGET = "arms.2.budget"


@pytest.fixture(scope="module")
def prepared(migrated_sqlite: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A database with an account and the paper's studies, and the cookie of somebody who signed in."""
    path = tmp_path_factory.mktemp("prepared") / "hatlab.sqlite3"
    shutil.copy(migrated_sqlite, path)
    database = Database(f"sqlite:///{path}")
    experimenter = Experimenter(with_account(fake_lab(database)))
    assert experimenter.sign_in().status_code == 303
    with database.engine.connect() as connection:
        connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
    database.close()
    return path, experimenter.client.cookies["hatlab-admin"]


@pytest.fixture
def person(prepared: tuple[Path, str], tmp_path: Path) -> Iterator[Experimenter]:
    """Somebody who is signed in, in a lab of their own with the two studies of the paper."""
    path = tmp_path / "hatlab.sqlite3"
    shutil.copy(prepared[0], path)
    database = Database(f"sqlite:///{path}")
    experimenter = Experimenter(fake_lab(database))
    experimenter.client.cookies.set("hatlab-admin", prepared[1])
    yield experimenter
    database.close()


@pytest.fixture
def draft(person: Experimenter) -> str:
    """The slug of a new draft of Traffic Junction."""
    answer = person.post("/admin/studies/new", source="template:traffic-junction", title="Rush hour", slug="")
    assert answer.headers["location"] == "/admin/studies/rush-hour"
    return "rush-hour"


def study(lab: Lab, slug: str) -> Study:
    with lab.database.reading() as db:
        return studies.find(db, slug)


def versions(lab: Lab, slug: str) -> list[tuple[int, str, str]]:
    with lab.database.reading() as db:
        found = rows.versions(db, studies.find(db, slug).row.id)
        return [(each.number, each.definition, each.sha256) for each in found]


def test_a_template_becomes_a_draft_that_can_be_launched_as_it_is(person: Experimenter, draft: str) -> None:
    page = person.get(f"/admin/studies/{draft}").text
    assert "Rush hour" in page
    assert 'aria-invalid="true"' not in page
    assert study(person.lab, draft).version is None


def test_a_copy_has_the_settings_and_another_address(person: Experimenter) -> None:
    answer = person.post("/admin/studies/traffic-junction/copy")
    assert answer.headers["location"] == "/admin/studies/copy-of-cross-the-junction"
    copied, origin = (study(person.lab, slug) for slug in ("copy-of-cross-the-junction", "traffic-junction"))
    assert copied.values["arms"] == origin.values["arms"]
    assert (copied.row.status, copied.row.mode, copied.row.title) == (
        "draft",
        "test",
        "Copy of Cross the junction",
    )


@pytest.mark.parametrize(
    ("fields", "wrong"),
    [
        ({"source": "", "title": "x"}, "source"),
        ({"source": "template:../../etc/passwd", "title": "x"}, "source"),
        ({"source": "copy:nothing", "title": "x"}, "source"),
        ({"source": "template:parent-child", "title": "  "}, "title"),
        ({"source": "template:parent-child", "title": "x" * 201}, "title"),
        ({"source": "template:parent-child", "title": "x", "slug": "Not Allowed"}, "slug"),
        ({"source": "template:parent-child", "title": "x", "slug": "new"}, "slug"),
        ({"source": "template:parent-child", "title": "x", "slug": "parent-child"}, "slug"),
    ],
)
def test_what_is_wrong_with_a_new_study_is_said_at_the_field(
    person: Experimenter, fields: dict[str, str], wrong: str
) -> None:
    answer = person.post("/admin/studies/new", **fields)
    assert answer.status_code == 422
    assert f'id="{wrong}-error"' in answer.text
    assert f'href="#{wrong}"' in answer.text
    assert person.get("/admin").text.count("<tr>") == 3


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (BUDGET, "0.5", "Budget 0.5 does not match this agent, which was trained for 0.3."),
        (BUDGET, "a lot", "Enter a number, such as 0.5."),
        (BUDGET, "0", "Enter more than 0."),
        (BUDGET, "nan", "Enter at most 1."),
        ("arms.0.name", "Full Speed", "Use small letters, digits and hyphens, at most 48."),
        ("arms.1.name", "budget-100", "budget-100 is the name of another arm."),
        ("arms.0.places", "", "Enter a whole number."),
        ("arms.0.places", "0", "Enter at least 1."),
        ("arms.0.bundle", "traffic_junction/gone", "No agent traffic_junction/gone is loaded."),
        ("arms.0.bundle", "parent_child/prototype-9", "This agent was trained in parent_child, not in"),
        ("arms.0.communication", "one-hot", "is not used in traffic_junction."),
        ("title", "", "Fill this in."),
        ("step_limit", "201", "Enter at most 200."),
        ("step_limit", "4.5", "Enter a whole number."),
        ("trials_per_block", "twenty", "Enter a whole number."),
        ("arrival", "1.5", "Enter at most 1."),
        ("texts.consent", " \r\n\r\n ", "Write at least one."),
        ("texts.consent", "x" * 4001, "Use at most 4000 characters."),
        ("completion_code", "no spaces", "Use letters, digits, hyphens and underscores, at most 64."),
        ("completion_code", "", "Fill this in."),
        ("completion_url", "http://plain.example/{code}", "Begin with https://"),
        ("completion_url", "http://localhost.example/{code}", "Begin with https://"),
        ("completion_url", "https://lab.example/done", "Must contain {code}."),
        ("lease_min", "1", "Enter at least 5."),
        ("quiz_tries", "6", "Enter at most 5."),
        ("attention_failures", "", "Enter a whole number."),
        ("texts.language", "English", "Use a language"),
        ("gate.width_min", "10", "Enter at least 320."),
        ("codes.failed", "not so", "Use letters, digits, hyphens and underscores, at most 64."),
        ("pay.reward_minor", "3.20", "Enter a whole number."),
        ("pay.cap_participant_minor", "10", "Reward and largest bonus are 420 together."),
        ("pay.cap_study_minor", "", "Fill this in."),
        ("quiz", "[[quiz]\nkey = 1", "(at line 1, column 7)."),
        ("quiz", "[[questions]]\nkey = 1", "Only [[quiz]] may stand here, not questions."),
        ("quiz", 'quiz = "x"', "Begin each part with [[quiz]]."),
        ("quiz", "[[quiz]]\nkey = 2026-01-01", "There is a date or a time, which no question has."),
        ("quiz", '[[quiz]]\nkey = "a"\ntext = "b"\noptions = ["c", "d"]', "Question 1, answer: is missing."),
        (
            "quiz",
            '[[quiz]]\nkey = "a"\nrole = "child"\ntext = "b"\noptions = ["c", "d"]\nanswer = 1',
            "Question 1, role: nobody plays the child in traffic_junction.",
        ),
        (
            "attention",
            '[[attention]]\nkey = "a"\nafter = 99\ntext = "b"\noptions = ["c", "d"]\nanswer = 1',
            "Check 1, after: a session has only 20 main rounds.",
        ),
        (
            "questionnaires",
            '[[questionnaires]]\nkey = "a"\ntitle = "b"\n\n[[questionnaires.items]]\nkey = "c"\ntext = "d"',
            "Questionnaire 1, item 1: a choice needs two options or more, and nothing else has options.",
        ),
        (
            "questionnaires",
            '[[questionnaires]]\nkey = "quiz"\ntitle = "b"',
            "Questionnaire 1, items: is missing.",
        ),
    ],
)
def test_a_wrong_field_keeps_its_value_and_gets_a_message(
    person: Experimenter, draft: str, path: str, value: str, message: str
) -> None:
    answer = person.save(draft, {path: value})
    assert answer.status_code == 422
    assert message in answer.text
    field = answer.text[answer.text.index(f'id="{path}"') - 40 :]
    assert f'aria-invalid="true" aria-describedby="{path}-error"' in field[:400]
    assert f'id="{path}-error"' in answer.text
    assert f'<a href="#{path}">' in answer.text
    again = fields_of(person.get(f"/admin/studies/{draft}").text)
    assert again[path] == value.strip().replace("\r\n", "\n")


def test_a_draft_with_errors_cannot_be_launched(person: Experimenter, draft: str) -> None:
    person.save(draft, {BUDGET: "0.5"})
    assert person.get(f"/admin/studies/{draft}/launch").headers["location"] == f"/admin/studies/{draft}"
    forced = person.post(f"/admin/studies/{draft}/launch", base=study(person.lab, draft).base)
    assert forced.headers["location"] == f"/admin/studies/{draft}"
    assert versions(person.lab, draft) == []


def test_every_field_that_is_changed_arrives_in_the_definition(person: Experimenter, draft: str) -> None:
    changes = {
        "title": "Rush hour, again",
        "attention": "",
        "quiz": '[[quiz]]\r\nkey = "one"\r\ntext = "1 + 1?"\r\noptions = ["1", "2"]\r\nanswer = 2',
        "questionnaires": """[[questionnaires]]
key = "after"
title = "After"
when = "block"

[[questionnaires.items]]
key = "hard"
text = "How hard was it?"
kind = "scale"
maximum = 10
step = 1
required = false""",
        "quiz_tries": "3",
        "attention_failures": "1",
        "texts.instructions": "First.\r\n\r\nSecond.",
        "texts.language": "ar",
        "texts.direction": "rtl",
        "gate.width_min": "800",
        "gate.refresh_min_hz": "12,5",
        "codes.withdrawn": "BYE",
        "pay.currency": "EUR",
        "pay.reward_minor": "150",
        "trials_per_block": "5",
        "practice_rounds": "0",
        "step_limit": "30",
        "arrival": "0,1",
        "arms.0.name": "all",
        "arms.0.places": "7",
        "texts.consent": "One.\r\n\r\n\r\nTwo,\r\nstill two.",
        "texts.consent_version": "2",
        "texts.welcome": "Hello.",
        "contact": "ada@lab.example",
        "duration_min": "9",
        "reward_text": "£1.50",
        "completion_code": "C0DE",
        "completion_url": "https://lab.example/?cc={code}",
        "lease_min": "30",
        "situation_seed": "99",
    }
    fields = fields_of(person.get(f"/admin/studies/{draft}").text)
    del fields["arms.1.overlay"], fields["gate.keyboard"]
    answer = person.client.post(f"/admin/studies/{draft}", data=fields | changes | {"action": "save"})
    assert answer.headers["location"] == f"/admin/studies/{draft}?saved=1"
    person.confirm(draft, "launch")
    made = study(person.lab, draft).definition
    assert made is not None
    assert made.texts.consent == ("One.", "Two,\nstill two.")
    assert (made.arms[0].name, made.arms[0].places, made.arrival) == ("all", 7, 0.1)
    assert [arm.overlay for arm in made.arms] == [True, False, True]
    assert (made.title, made.trials_per_block, made.practice_rounds, made.step_limit) == (
        "Rush hour, again",
        5,
        0,
        30,
    )
    assert (made.reward_text, made.duration_min, made.lease_min, made.situation_seed) == ("£1.50", 9, 30, 99)
    assert (made.completion_code, made.completion_url) == ("C0DE", "https://lab.example/?cc={code}")
    assert [(each.key, each.answer) for each in made.quiz] == [("one", 2)]
    assert (made.quiz_tries, made.attention, made.attention_failures) == (3, (), 1)
    [after] = made.questionnaires
    assert (after.when, len(after.items[0].values), after.items[0].required) == ("block", 11, False)
    assert (made.texts.instructions, made.texts.language, made.texts.direction) == (
        ("First.", "Second."),
        "ar",
        "rtl",
    )
    assert (made.gate.width_min, made.gate.refresh_min_hz, made.gate.keyboard) == (800, 12.5, False)
    assert (made.codes.withdrawn, made.codes.screened_out) == ("BYE", "LOOKED-IN")
    assert made.pay is not None
    assert (made.pay.currency, made.pay.reward_minor, made.pay.partial_minor) == ("EUR", 150, 100)


def test_nothing_of_a_whole_study_is_lost_by_saving_it_and_every_field_stands_on_the_page(
    person: Experimenter,
) -> None:
    for slug in ("parent-child", "traffic-junction"):
        before = study(person.lab, slug).definition
        assert before is not None
        fields = set(fields_of(person.get(f"/admin/studies/{slug}").text))
        person.save(slug, {"title": "Another title"})
        after = study(person.lab, slug).values
        assert read(after) == before.model_copy(update={"title": "Another title"})
        leaves = set(before.model_dump()) - {"arms", "texts", "gate", "codes", "pay", "slug", "task"}
        leaves -= {"environment", "panel_bundle", "arrival", "child_sees_parent", "token_probe"}
        assert leaves <= fields
        for group in ("texts", "gate", "codes", "pay"):
            names = {f"{group}.{name}" for name in getattr(before, group).model_dump()}
            assert names <= fields, group


def test_without_any_amount_a_study_states_no_pay(person: Experimenter, draft: str) -> None:
    fields = fields_of(person.get(f"/admin/studies/{draft}").text)
    amounts = {name: "" for name in fields if name.startswith("pay.") and name != "pay.currency"}
    assert len(amounts) == 7
    person.save(draft, amounts)
    assert study(person.lab, draft).values["pay"] is None
    person.save(draft, {"pay.bonus_max_minor": "5"})
    assert study(person.lab, draft).values["pay"] == {"currency": "GBP", "bonus_max_minor": "5"}


def test_a_text_that_is_no_toml_stays_as_it_was_typed_and_cannot_be_launched(
    person: Experimenter, draft: str
) -> None:
    typed = '[[quiz]]\nkey = "half'
    assert person.save(draft, {"quiz": typed}).status_code == 422
    page = person.get(f"/admin/studies/{draft}").text
    assert fields_of(page)["quiz"] == typed
    assert 'id="quiz-error"' in page
    assert '<a href="#questions" class="wrong">' in page
    assert person.get(f"/admin/studies/{draft}/launch").status_code == 303
    assert versions(person.lab, draft) == []


def test_the_way_of_a_participant_names_every_question(person: Experimenter) -> None:
    page = person.get("/admin/studies/parent-child").text
    way = re.findall(
        r'<span>([^<]+)</span><span class="num">([^<]*)</span>', page[page.index('class="flow"') :]
    )
    assert way[:6] == [
        ("Entry and consent", ""),
        ("How to play as parent", ""),
        ("Practice as parent", "1"),
        ("Quiz", "3"),
        ("Rounds as parent", "20"),
        ("Questions about the rounds", "6"),
    ]
    assert way[-4:] == [
        ("Attention checks in between", "2"),
        ("What the signs mean", ""),
        ("Last questions", "11"),
        ("Completion code", ""),
    ]


def test_what_the_child_sees_can_be_turned_off(person: Experimenter) -> None:
    fields = fields_of(person.get("/admin/studies/parent-child").text)
    del fields["child_sees_parent"]
    person.client.post("/admin/studies/parent-child", data=fields | {"action": "save"})
    assert study(person.lab, "parent-child").values["child_sees_parent"] is False


def test_arms_are_added_and_removed_without_losing_what_was_typed(person: Experimenter, draft: str) -> None:
    added = person.save(draft, {"contact": "ada"}, action="add-arm")
    assert added.headers["location"] == f"/admin/studies/{draft}#arms"
    values = study(person.lab, draft).values
    assert [arm["name"] for arm in values["arms"]] == ["budget-100", "budget-050", "budget-030", "arm-4"]
    assert values["contact"] == "ada"
    person.save(draft, action="remove-arm-1")
    assert [arm["name"] for arm in study(person.lab, draft).values["arms"]] == [
        "budget-100",
        "budget-030",
        "arm-4",
    ]


@pytest.mark.parametrize(
    "action", ["remove-arm-²", "remove-arm-999999999999", "remove-arm-", "remove-arm--1"]
)
def test_an_arm_that_is_not_there_cannot_be_removed(person: Experimenter, draft: str, action: str) -> None:
    assert person.save(draft, action=action).status_code == 303
    assert len(study(person.lab, draft).values["arms"]) == 3


def test_however_many_arms_were_typed_one_more_is_only_one_too_many(person: Experimenter, draft: str) -> None:
    person.save(draft, {f"arms.{n}.name": f"a{n}" for n in range(100)}, action="add-arm")
    assert len(study(person.lab, draft).values["arms"]) == 101


def test_launching_asks_then_freezes_the_version_and_opens_the_study(
    person: Experimenter, draft: str
) -> None:
    assert person.save(draft, action="launch").headers["location"] == f"/admin/studies/{draft}/launch"
    question = person.get(f"/admin/studies/{draft}/launch").text
    assert "can never be changed" in question
    assert "counts as test data" in question
    assert versions(person.lab, draft) == []
    assert person.confirm(draft, "launch").headers["location"] == f"/admin/studies/{draft}/monitor"
    [(number, definition, sha256)] = versions(person.lab, draft)
    assert (number, study(person.lab, draft).row.status) == (1, "open")
    assert sha256 == canonical.sha256(definition)
    assert json.loads(definition)["title"] == "Rush hour"


@pytest.mark.parametrize(
    ("link", "warned"),
    [("http://127.0.0.1:8010/submissions/complete?cc={code}", True), ("https://lab.example/{code}", False)],
)
def test_launching_says_so_if_the_completion_link_leads_to_this_machine(
    person: Experimenter, draft: str, link: str, warned: bool
) -> None:
    assert person.save(draft, {"completion_url": link}, action="launch").status_code == 303
    question = person.get(f"/admin/studies/{draft}/launch").text
    assert ("leads to this machine" in question) is warned
    person.confirm(draft, "launch")
    [(_, definition, _)] = versions(person.lab, draft)
    assert json.loads(definition)["completion_url"] == link


def test_every_launched_version_can_be_read_as_it_was_launched(person: Experimenter, draft: str) -> None:
    person.confirm(draft, "launch")
    person.save(draft, {"title": "Second"})
    person.confirm(draft, "launch")
    page = person.get(f"/admin/studies/{draft}").text
    for number, definition, sha256 in versions(person.lab, draft):
        url = f"/admin/studies/{draft}/versions/{number}.json"
        assert f'href="{url}"' in page
        assert sha256 in page
        answer = person.get(url)
        assert answer.headers["content-type"] == "application/json"
        assert answer.content == definition.encode()
        assert hashlib.sha256(answer.content).hexdigest() == sha256
    assert person.get(f"/admin/studies/{draft}/versions/3.json").status_code == 404
    assert person.get(f"/admin/studies/{draft}/versions/x.json").status_code == 422


def test_changing_a_launched_study_makes_the_next_version_and_leaves_the_first(
    person: Experimenter, draft: str
) -> None:
    person.confirm(draft, "launch")
    first = versions(person.lab, draft)
    person.save(draft, {"title": "Rush hour II", "trials_per_block": "3", "attention": ""})
    assert versions(person.lab, draft) == first
    assert study(person.lab, draft).row.title == "Rush hour"
    assert "Draft of version 2" in person.get(f"/admin/studies/{draft}").text
    assert "Launch version 2?" in person.get(f"/admin/studies/{draft}/launch").text
    person.confirm(draft, "launch")
    assert versions(person.lab, draft)[:1] == first
    assert [number for number, _, _ in versions(person.lab, draft)] == [1, 2]
    assert study(person.lab, draft).row.title == "Rush hour II"


def test_saving_what_is_launched_already_leaves_nothing_to_launch(person: Experimenter) -> None:
    for slug in ("parent-child", "traffic-junction"):
        person.save(slug)
        assert not study(person.lab, slug).has_draft
        assert "nothing to launch" in person.get(f"/admin/studies/{slug}?saved=1").text
        assert person.get(f"/admin/studies/{slug}/launch").status_code == 303


def test_of_two_launches_at_once_one_makes_a_version_and_the_other_is_told(
    person: Experimenter, draft: str
) -> None:
    url = f"/admin/studies/{draft}/launch"
    fields = fields_of(person.get(url).text, url)
    others = [Experimenter(person.lab) for _ in range(4)]
    for other in others:
        other.client.cookies.update(person.client.cookies)
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(lambda other: other.client.post(url, data=fields), others))
    assert sorted(answer.status_code for answer in answers) == [303, 409, 409, 409]
    assert [number for number, _, _ in versions(person.lab, draft)] == [1]
    told = next(answer.text for answer in answers if answer.status_code == 409)
    assert "changed or launched meanwhile" in told


def test_a_draft_that_was_changed_after_the_question_is_not_launched(
    person: Experimenter, draft: str
) -> None:
    url = f"/admin/studies/{draft}/launch"
    confirmed = fields_of(person.get(url).text, url)
    person.save(draft, {"title": "Something else"})
    assert person.client.post(url, data=confirmed).status_code == 409
    assert versions(person.lab, draft) == []


def test_two_people_who_edit_at_once_do_not_overwrite_each_other_unseen(
    person: Experimenter, draft: str
) -> None:
    url = f"/admin/studies/{draft}"
    mine = fields_of(person.get(url).text)
    person.save(draft, {"contact": "grace"})
    answer = person.client.post(url, data=mine | {"contact": "ada", "action": "save"})
    assert answer.status_code == 409
    assert "Somebody else saved" in answer.text
    assert fields_of(answer.text)["contact"] == "ada"
    assert study(person.lab, draft).values["contact"] == "grace"
    person.client.post(url, data=fields_of(answer.text) | {"action": "save"})
    assert study(person.lab, draft).values["contact"] == "ada"


def test_a_draft_is_discarded_only_after_asking_and_never_the_launched_version(person: Experimenter) -> None:
    slug = "traffic-junction"
    person.save(slug, {"contact": "nobody"})
    assert study(person.lab, slug).has_draft
    assert "cannot be brought back" in person.get(f"/admin/studies/{slug}/discard").text
    assert study(person.lab, slug).has_draft
    person.confirm(slug, "discard")
    assert not study(person.lab, slug).has_draft
    assert len(versions(person.lab, slug)) == 1


def test_a_study_that_was_never_launched_keeps_its_draft(person: Experimenter, draft: str) -> None:
    assert person.get(f"/admin/studies/{draft}/discard").status_code == 303
    answer = person.post(f"/admin/studies/{draft}/discard", base=study(person.lab, draft).base)
    assert answer.status_code == 422
    assert study(person.lab, draft).has_draft


def test_pausing_opening_and_closing_change_the_state_and_closing_asks(person: Experimenter) -> None:
    slug = "parent-child"
    assert person.post(f"/admin/studies/{slug}/pause", back="list").headers["location"] == "/admin"
    assert study(person.lab, slug).row.status == "paused"
    person.post(f"/admin/studies/{slug}/open")
    assert study(person.lab, slug).row.status == "open"
    assert "Close this study?" in person.get(f"/admin/studies/{slug}/close").text
    assert study(person.lab, slug).row.status == "open"
    person.confirm(slug, "close")
    assert study(person.lab, slug).row.status == "closed"


def test_a_draft_cannot_be_opened_before_its_launch(person: Experimenter, draft: str) -> None:
    for action in ("open", "pause", "close"):
        assert person.post(f"/admin/studies/{draft}/{action}").status_code == 422
    assert study(person.lab, draft).row.status == "draft"


def test_going_live_asks_first(person: Experimenter) -> None:
    slug = "parent-child"
    assert study(person.lab, slug).row.mode == "test"
    assert "test data never become live data" in person.get(f"/admin/studies/{slug}/mode").text
    assert study(person.lab, slug).row.mode == "test"
    person.confirm(slug, "mode")
    assert study(person.lab, slug).row.mode == "live"
    person.confirm(slug, "mode")
    assert study(person.lab, slug).row.mode == "test"
    assert person.post(f"/admin/studies/{slug}/mode", mode="robot").status_code == 422


def test_a_hostile_title_is_text_on_every_page(person: Experimenter) -> None:
    hostile = "<script>alert(1)</script>\"'><img src=x onerror=alert(2)>{{7*7}}"
    answer = person.post("/admin/studies/new", source="template:parent-child", title=hostile, slug="hostile")
    assert answer.status_code == 303
    pages = ["/admin", "/admin/studies/new", "/admin/studies/hostile", "/admin/studies/hostile/launch"]
    texts = [person.get(page).text for page in pages]
    person.confirm("hostile", "launch")
    person.save("hostile", {"contact": hostile, "arms.0.name": hostile})
    more = ["monitor", "close", "mode", "discard", ""]
    texts += [person.get(f"/admin/studies/hostile/{page}".rstrip("/")).text for page in more]
    for text in texts:
        assert "<script>alert" not in text
        assert "<img" not in text
        assert "{{7*7}}" in text
    assert fields_of(texts[2])["title"] == hostile


def test_an_unknown_study_is_not_found_on_every_page(person: Experimenter) -> None:
    for page in ("", "/launch", "/close", "/mode", "/discard", "/monitor", "/export.zip"):
        assert person.get(f"/admin/studies/nothing{page}").status_code == 404, page
    for action in ("", "/launch", "/close", "/open", "/pause", "/mode", "/discard", "/copy"):
        assert person.post(f"/admin/studies/nothing{action}").status_code == 404, action


def test_participant_links_carry_what_each_marketplace_fills_in(person: Experimenter) -> None:
    page = person.get("/admin/studies/parent-child").text
    base = "http://127.0.0.1:8000/s/parent-child"
    pids = "?PROLIFIC_PID={{%PROLIFIC_PID%}}&amp;STUDY_ID={{%STUDY_ID%}}&amp;SESSION_ID={{%SESSION_ID%}}"
    assert f'value="{base}{pids}"' in page
    assert page.count(f'value="{base}"') == 2
