"""What tests of the services do again and again: launch a study, let somebody in, play."""

from collections.abc import Callable
from typing import Any

from server.domain.study import StudyDefinition
from server.domain.view import View
from server.services import enrol, play
from server.services.enrol import DeviceReport, Enrolled
from server.services.lab import Lab
from server.services.play import PageChange
from server.storage import studies
from server.storage.participants import ParticipantRow
from tests.fakes import definition, timing

DESKTOP = DeviceReport("desktop", "Firefox 140", "1280x720")
Chooser = Callable[[View], int]


def launch(lab: Lab, study: StudyDefinition, status: str = "open", mode: str = "live") -> int:
    with lab.database.writing() as db:
        study_id = studies.add(db, study.slug, study.title, mode, "", lab.now_utc())
        studies.hold(db, study_id)
        studies.add_version(db, study_id, study.canonical, study.sha256, lab.now_utc())
        studies.set_status(db, study_id, status)
    return study_id


def prolific(name: str) -> dict[str, str]:
    return {"PROLIFIC_PID": name, "STUDY_ID": "s1", "SESSION_ID": f"sub-{name}"}


def come_in(lab: Lab, slug: str, name: str = "ada", device: DeviceReport = DESKTOP) -> str:
    """Consent; the key of the session."""
    with lab.database.writing() as db:
        result = enrol.consent(db, lab, slug, prolific(name), agree=True, device=device)
    assert isinstance(result, Enrolled)
    return result.key


def person(lab: Lab, key: str) -> ParticipantRow:
    with lab.database.reading() as db:
        return enrol.participant_by_key(db, lab, key)


def go_on(lab: Lab, key: str) -> str:
    """Leave the present page; the name of the next one."""
    with lab.database.writing() as db:
        participant = enrol.participant_by_key(db, lab, key)
        enrol.advance(db, lab, participant, participant.page)
    return person(lab, key).page


def open_round(lab: Lab, key: str, after: int | None = None) -> View | PageChange:
    with lab.database.writing() as db:
        return play.open_round(db, lab, enrol.participant_by_key(db, lab, key), after)


def decide(lab: Lab, key: str, view: View, action: int, **changes: Any) -> View:
    with lab.database.writing() as db:
        participant = enrol.participant_by_key(db, lab, key)
        sent = timing(**changes)
        return play.decide(db, lab, participant, view["round"], view["seq"] + 1, action, sent)


def first(view: View) -> int:
    return int(view["actions"][0])


def play_round(lab: Lab, key: str, view: View, choose: Chooser = first) -> View:
    while view["over"] is None:
        view = decide(lab, key, view, choose(view))
    return view


def play_block(lab: Lab, key: str, choose: Chooser = first) -> list[View]:
    """Every round of the present block; the last view of each."""
    ends, after = [], None
    while True:
        view = open_round(lab, key, after)
        if isinstance(view, PageChange):
            return ends
        ends.append(play_round(lab, key, view, choose))
        after = view["round"]


def play_all(lab: Lab, key: str, choose: Chooser = first) -> list[View]:
    """From the first instructions to the code."""
    ends = []
    while person(lab, key).page != "complete":
        if go_on(lab, key).startswith("play"):
            ends += play_block(lab, key, choose)
    return ends


def playing(lab: Lab, slug: str, name: str = "ada", **changes: Any) -> str:
    """A person of a newly launched study, at the first round."""
    launch(lab, definition(slug, **changes))
    key = come_in(lab, slug, name)
    go_on(lab, key)
    return key
