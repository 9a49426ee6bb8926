"""Studies as services, on both databases; through the pages they are tested in web/test_admin_studies."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from server.domain import canonical
from server.domain.errors import BadInputError, DefinitionError, NotFoundError
from server.domain.study import StudyDefinition, from_json
from server.services import studies
from server.services.lab import Lab
from server.services.studies import DraftChangedError
from server.services.study_messages import SENTENCES, mistakes_of
from server.storage import studies as rows
from tests.fakes import another_worker, definition


@pytest.fixture
def draft(lab: Lab) -> str:
    with lab.database.writing() as db:
        return studies.create_from_template(db, lab, "traffic-junction", "Rush hour!  Again", "")


def base_of(lab: Lab, slug: str) -> str:
    with lab.database.reading() as db:
        return studies.find(db, slug).base


def launch(lab: Lab, slug: str, base: str) -> int | None:
    """The number of the version; None if somebody else was faster."""
    try:
        with lab.database.writing() as db:
            return studies.launch(db, lab, slug, base).number
    except DraftChangedError:
        return None


def test_the_papers_studies_are_there_once_however_often_one_asks(lab: Lab) -> None:
    with lab.database.writing() as db:
        assert studies.ensure_demo_studies(db, lab) == ["parent-child", "traffic-junction"]
    with lab.database.writing() as db:
        assert studies.ensure_demo_studies(db, lab) == []
        found = studies.every(db)
    assert [(each.row.slug, each.row.status, each.row.mode) for each in found] == [
        ("parent-child", "open", "test"),
        ("traffic-junction", "open", "test"),
    ]
    for each in found:
        assert each.version is not None
        assert each.definition is not None
        assert (each.version.number, each.version.sha256) == (1, each.definition.sha256)
        assert not each.has_draft
        assert studies.judged(each.values, lab)[1] == {}


def test_what_is_stored_as_a_version_is_the_definition_and_its_hash(lab: Lab, draft: str) -> None:
    assert launch(lab, draft, base_of(lab, draft)) == 1
    with lab.database.reading() as db:
        version = rows.newest_version(db, studies.find(db, draft).row.id)
    assert version is not None
    assert version.sha256 == canonical.sha256(version.definition)
    assert from_json(version.definition).canonical == version.definition


def test_addresses_are_made_from_titles_and_never_twice(lab: Lab, draft: str) -> None:
    assert draft == "rush-hour-again"
    with lab.database.writing() as db:
        again = studies.create_from_template(db, lab, "traffic-junction", "Rush hour, again", "")
        nameless = studies.create_from_template(db, lab, "traffic-junction", "交差点", "")
        reserved = studies.create_from_template(db, lab, "traffic-junction", "New", "")
        long = studies.create_from_template(db, lab, "traffic-junction", "a " * 100, "")
    assert (again, nameless, reserved) == ("rush-hour-again-2", "study", "new-2")
    assert len(long) <= 48


def test_many_who_launch_at_once_make_one_version(lab: Lab, draft: str) -> None:
    base = base_of(lab, draft)
    workers = [another_worker(lab) for _ in range(6)]
    with ThreadPoolExecutor(6) as pool:
        numbers = list(pool.map(lambda worker: launch(worker, draft, base), workers))
    assert sorted(number or 0 for number in numbers) == [0, 0, 0, 0, 0, 1]
    with lab.database.reading() as db:
        assert len(rows.versions(db, studies.find(db, draft).row.id)) == 1


def test_many_who_create_at_once_get_addresses_of_their_own(lab: Lab) -> None:
    def create(worker: Lab) -> str:
        """On PostgreSQL the slower one may be told to choose another address, and tries again."""
        while True:
            try:
                with worker.database.writing() as db:
                    return studies.create_from_template(db, worker, "parent-child", "Same", "")
            except DefinitionError as error:
                assert error.fields == {"slug": studies.taken(error.fields["slug"].split()[0])}  # noqa: PT017

    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(create, [another_worker(lab) for _ in range(4)]))
    assert sorted(made) == ["same", "same-2", "same-3", "same-4"]


def test_a_launch_needs_agents_that_are_loaded(lab: Lab, draft: str) -> None:
    bare = another_worker(lab)
    object.__setattr__(bare, "bundles", {})
    with pytest.raises(DefinitionError) as caught, lab.database.writing() as db:
        studies.launch(db, bare, draft, base_of(lab, draft))
    assert set(caught.value.fields) == {"arms.0.bundle", "arms.1.bundle", "arms.2.bundle"}


def test_a_draft_cannot_change_what_the_study_is(lab: Lab, draft: str) -> None:
    with lab.database.writing() as db:
        values = dict(studies.find(db, draft).values)
        changes = {
            "slug": "other",
            "task": "parent_child",
            "environment": "traffic_junction/easy",
            "title": "T",
        }
        studies.save_draft(db, lab, draft, values | changes)
        kept = studies.find(db, draft).values
    assert (kept["slug"], kept["task"], kept["environment"]) == (
        draft,
        "traffic_junction",
        "traffic_junction/medium",
    )
    assert kept["title"] == "T"


def test_studies_that_are_not_there_are_not_found(lab: Lab) -> None:
    for ask in (
        lambda db: studies.find(db, "nothing"),
        lambda db: studies.template("nothing"),
        lambda db: studies.template("../studies/parent-child"),
        lambda db: studies.set_status(db, "nothing", "open"),
        lambda db: studies.copy(db, lab, "nothing"),
    ):
        with pytest.raises(NotFoundError), lab.database.writing() as db:
            ask(db)


def test_only_what_was_launched_can_be_opened(lab: Lab, draft: str) -> None:
    with pytest.raises(BadInputError), lab.database.writing() as db:
        studies.set_status(db, draft, "open")


def test_every_limit_of_a_definition_has_a_sentence_for_people() -> None:
    values = definition("traffic-junction").model_dump(mode="json")
    tried = {
        "arms": [],
        "duration_min": 10**400,
        "situation_seed": -1,
        "lease_min": None,
        "arrival": "",
        "title": "x" * 201,
        "contact": "",
        "completion_code": " ",
        "task": "chess",
        "step_limit": 2.5,
        "trials_per_block": True,
    }
    for field, value in tried.items():
        study, wrong = mistakes_of(values | {field: value}, lambda _: {})
        assert study is None or field == "trials_per_block"
        assert all(text.endswith(".") and "Input should" not in text for text in wrong.values()), wrong
    assert len(SENTENCES) == len(set(SENTENCES))


def test_a_definition_without_mistakes_comes_back_whole() -> None:
    wanted = definition("parent-child")
    study, wrong = mistakes_of(wanted.model_dump(mode="json"), lambda _: {})
    assert (study, wrong) == (wanted, {})
    assert isinstance(study, StudyDefinition)
