"""Erasing one person leaves nothing of them anywhere, and everybody else as they were."""

from pathlib import Path

import pytest
from sqlalchemy import func, insert, select

from server.domain.errors import BadInputError, NotFoundError
from server.domain.flow import Stage
from server.services import enrol, erase, flow, watch
from server.services.erase import Known
from server.services.lab import Lab
from server.services.verify import verify
from server.storage import postings, studies
from server.storage.database import Database
from server.storage.postings import PaymentRow, SubmissionRow
from server.storage.tables import metadata, payment
from tests.fakes import fake_lab
from tests.server.services.steps import DESKTOP, come_in, launch, person, prolific
from tests.server.services.walks import at_end, definition, entered, walk_to

SLUG = "traffic-junction"


def rows(lab: Lab) -> dict[str, int]:
    with lab.database.reading() as db:
        return {
            table.name: int(db.read(select(func.count()).select_from(table)).scalar_one())
            for table in metadata.sorted_tables
        }


def through(lab: Lab, name: str = "ada") -> str:
    """Somebody who went through everything and whose window was watched."""
    key = come_in(lab, SLUG, name)
    with lab.database.writing() as db:
        who = enrol.participant_by_key(db, lab, key)
        watch.keep(db, lab, who, "visit-0001", "instructions:1", [(0, "loaded", "1280x720", 3.25)])
    walk_to(lab, key, at_end)
    return key


def found(lab: Lab, name: str) -> Known:
    with lab.database.reading() as db:
        return erase.find_external(db, lab, SLUG, "prolific", name)


def gone(lab: Lab, who: Known) -> None:
    with lab.database.writing() as db:
        erase.erase(db, who)


def paid(lab: Lab, name: str, state: str) -> None:
    """A payment to somebody, and what the marketplace told of their submission."""
    who = found(lab, name)
    with lab.database.writing() as db:
        db.hold()
        now_utc = lab.now_utc()
        posting_id = postings.add(db, who.study_id, "prolific", f"post-{name}", "active", 3, "{}", now_utc)
        told = SubmissionRow(
            posting_id, f"sub-{name}", who.external_hash, "approved", "C", 0, "poll", now_utc
        )
        postings.keep_submissions(db, [told])
        row = PaymentRow(
            f"hatlab-bonus-sub-{name}", posting_id, who.participant_id or "", f"sub-{name}", "bonus", 120,
            "GBP", state, f"ref-{name}", "for ada", "admin", now_utc, None,
        )  # fmt: skip
        db.write(insert(payment), row._asdict())


def test_nothing_of_the_person_is_left_and_everybody_else_stays(lab: Lab) -> None:
    launch(lab, definition(SLUG, whole=True))
    through(lab, "bob")
    before = rows(lab)
    key = through(lab, "ada")
    who = person(lab, key).id
    assert {name for name, number in rows(lab).items() if number > before[name]} >= {
        "participant",
        "identity",
        "consent",
        "allocation",
        "trial",
        "event",
        "answer",
        "browser_event",
        "journey",
    }
    with lab.database.reading() as db:
        known = erase.find_participant(db, lab, SLUG, who)
    assert known.rows["rounds"] == 4
    assert "4 rounds" in known.text
    gone(lab, known)
    gone(lab, known)  # a second time, from another window: nobody is counted twice
    assert rows(lab) == before | {"erased": 1}
    assert verify(lab).clean
    with pytest.raises(NotFoundError, match="is known under that id"):
        found(lab, "ada")


def counts(lab: Lab) -> dict[str, int]:
    """The flow of the study's live people, without the stages that nobody came to."""
    with lab.database.reading() as db:
        row = studies.by_slug(db, SLUG)
        assert row is not None
        [live] = flow.flows(db, row.id, lab.now(), ["live"])
    assert sum(arm[Stage.ERASED] or 0 for arm in live.arms.values()) == live.whole[Stage.ERASED]
    return {stage.value: people for stage, people in live.whole.items() if people}


def test_whoever_was_erased_is_still_counted_in_the_flow_and_only_as_erased(lab: Lab) -> None:
    launch(lab, definition(SLUG, whole=True))
    for name in ("ada", "bob", "eve"):
        come_in(lab, SLUG, name)
    gone(lab, found(lab, "ada"))
    gone(lab, found(lab, "eve"))
    assert counts(lab) == {"consented": 3, "in_progress": 1, "erased": 2}


def test_of_payments_only_the_money_stays(lab: Lab) -> None:
    launch(lab, definition(SLUG, whole=True))
    through(lab)
    paid(lab, "ada", "done")
    gone(lab, found(lab, "ada"))
    with lab.database.reading() as db:
        [row] = [PaymentRow._make(each) for each in db.read(select(payment))]
    assert (row.amount_minor, row.currency, row.state) == (120, "GBP", "done")
    assert "ada" not in " ".join(map(str, row))
    assert rows(lab)["submission"] == 0


def test_nobody_is_erased_while_money_is_on_its_way_to_them(lab: Lab) -> None:
    launch(lab, definition(SLUG, whole=True))
    through(lab)
    paid(lab, "ada", "sent")
    before = rows(lab)
    with pytest.raises(BadInputError, match="on its way"):
        gone(lab, found(lab, "ada"))
    assert rows(lab) == before


def test_whoever_declined_is_found_by_the_marketplaces_id_and_may_be_asked_anew(lab: Lab) -> None:
    launch(lab, definition(SLUG, whole=True))
    with lab.database.writing() as db:
        enrol.consent(db, lab, SLUG, prolific("eve"), agree=False, device=DESKTOP)
    known = found(lab, "eve")
    assert (known.participant_id, known.refusal) == (None, "declined")
    assert "declined" in known.text
    gone(lab, known)
    assert rows(lab)["refusal"] == 0
    assert counts(lab)["declined"] == 1
    with lab.database.reading() as db:
        assert enrol.entry(db, lab, SLUG, prolific("eve")).kind == "consent"


def test_another_studys_people_are_not_found(lab: Lab) -> None:
    key = entered(lab, SLUG)
    launch(lab, definition("parent-child", whole=True))
    with lab.database.reading() as db:
        with pytest.raises(NotFoundError, match="nobody in parent-child is called P"):
            erase.find_participant(db, lab, "parent-child", person(lab, key).id)
        with pytest.raises(NotFoundError, match="no study is called nothing"):
            erase.find_participant(db, lab, "nothing", person(lab, key).id)
        with pytest.raises(NotFoundError, match="is known under that id of mturk"):
            erase.find_external(db, lab, SLUG, "mturk", "ada")


def test_whoever_is_owed_money_is_pointed_out(lab: Lab) -> None:
    launch(lab, definition(SLUG, whole=True))
    through(lab)
    come_in(lab, SLUG, "bob")
    assert found(lab, "ada").is_owed
    assert not found(lab, "bob").is_owed
    paid(lab, "ada", "done")
    assert not found(lab, "ada").is_owed


def test_the_file_itself_holds_nothing_of_the_person_afterwards(sqlite_database: Database) -> None:
    lab = fake_lab(sqlite_database)
    entered(lab, SLUG, "worker-with-a-rare-name")
    path = Path(str(sqlite_database.url.database))
    sqlite_database.settle()
    assert b"worker-with-a-rare-name" in path.read_bytes()
    gone(lab, found(lab, "worker-with-a-rare-name"))
    sqlite_database.settle()
    files = path.parent.glob(f"{path.name}*")
    assert b"worker-with-a-rare-name" not in b"".join(file.read_bytes() for file in files)
