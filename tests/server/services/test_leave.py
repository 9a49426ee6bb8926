"""Withdrawing at any stage: at once, for good, and with the data kept or deleted as the person says."""

import pytest

from server.domain.errors import ClosedError, NotFoundError
from server.services import enrol, erase, leave, play, watch
from server.services.lab import Lab
from server.services.play import PageChange
from server.services.verify import verify
from server.storage import answers, browser_log, journeys, trials
from tests.server.services.steps import decide, go_on, open_round, person
from tests.server.services.walks import asked, at_end, entered, hand_in, on, page, right, walk_to

SLUG = "traffic-junction"
STAGES = {
    "consented": on("instructions"),
    "instructed": on("practice"),
    "practised": asked("quiz"),
    "quizzed": on("play"),
    "playing": asked("attention"),
    "surveyed": lambda shown: shown.name == "survey:0",
}


def withdraw(lab: Lab, key: str, *, keep: bool) -> None:
    with lab.database.writing() as db:
        leave.withdraw(db, lab, enrol.participant_by_key(db, lab, key), keep=keep)


def left(lab: Lab, key: str) -> tuple[int, int, int]:
    """How many rounds, answers and window events there are of a person."""
    with lab.database.reading() as db:
        who = enrol.participant_by_key(db, lab, key).id
        found = (
            trials.of_participant(db, who),
            answers.of_participant(db, who),
            browser_log.of_participant(db, who),
        )
    rounds, given, window = (len(rows) for rows in found)
    return rounds, given, window


@pytest.mark.parametrize("keep", [True, False])
@pytest.mark.parametrize("stage", STAGES)
def test_a_person_can_withdraw_at_every_stage(lab: Lab, stage: str, keep: bool) -> None:
    key = entered(lab, SLUG)
    with lab.database.writing() as db:
        who = enrol.participant_by_key(db, lab, key)
        watch.keep(db, lab, who, "visit-0001", "instructions:1", [(0, "loaded", "1280x720", 1.0)])
    assert walk_to(lab, key, STAGES[stage]).state == stage
    before = left(lab, key)
    withdraw(lab, key, keep=keep)
    shown = page(lab, key)
    assert (shown.kind, shown.state, shown.code) == ("end", "withdrawn", "LEFT-EARLY")
    assert shown.data_kept is keep
    assert left(lab, key) == (before if keep else (0, 0, 0))
    after = person(lab, key)
    assert bool(after.erased_utc) is not keep
    assert (after.device, after.browser) == (("desktop", "Firefox 140") if keep else ("unknown", ""))
    with lab.database.reading() as db:
        assert journeys.of_participant(db, after.id)[-1].event == "withdraw"
    assert verify(lab).clean


def test_after_withdrawing_nothing_goes_on_and_nothing_more_is_kept(lab: Lab) -> None:
    key = entered(lab, SLUG)
    walk_to(lab, key, on("play"))
    view = open_round(lab, key)
    assert isinstance(view, dict)
    withdraw(lab, key, keep=True)
    before = left(lab, key)
    with pytest.raises(ClosedError):
        decide(lab, key, view, 0)
    assert isinstance(open_round(lab, key), PageChange)
    assert go_on(lab, key) == "play:1"
    hand_in(lab, key, {}, name="attention:1", attempt=1)
    with lab.database.writing() as db:
        who = enrol.participant_by_key(db, lab, key)
        assert watch.keep(db, lab, who, "visit-0002", "play:1", [(0, "blur", "", 1.0)]) == 0
    assert left(lab, key) == before


def test_whoever_has_kept_the_data_cannot_delete_them_by_withdrawing_again(lab: Lab) -> None:
    key = entered(lab, SLUG)
    walk_to(lab, key, on("play"))
    withdraw(lab, key, keep=True)
    before = left(lab, key)
    withdraw(lab, key, keep=False)
    assert left(lab, key) == before


def test_whoever_has_finished_stays_finished(lab: Lab) -> None:
    key = entered(lab, SLUG)
    walk_to(lab, key, at_end, right)
    finished = person(lab, key)
    withdraw(lab, key, keep=False)
    assert person(lab, key) == finished
    assert left(lab, key)[0] == 3


def test_what_was_deleted_does_not_come_back_by_what_was_under_way(lab: Lab) -> None:
    key = entered(lab, SLUG)
    walk_to(lab, key, on("play"))
    under_way = person(lab, key)  # read by another worker before the person withdrew
    withdraw(lab, key, keep=False)
    with lab.database.writing() as db:
        assert isinstance(play.open_round(db, lab, under_way, None), PageChange)
    with lab.database.writing() as db:
        assert watch.keep(db, lab, under_way, "visit-0003", "play:1", [(0, "blur", "", 1.0)]) == 0
    assert left(lab, key) == (0, 0, 0)


def test_a_step_that_meets_a_withdrawal_is_told_that_the_session_is_over(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    key = entered(lab, SLUG)
    walk_to(lab, key, on("play"))
    view = open_round(lab, key)
    assert isinstance(view, dict)
    before = play.step

    def slow_step(*args: object) -> object:
        withdraw(lab, key, keep=False)
        return before(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(play, "step", slow_step)
    with pytest.raises(ClosedError, match="over"):
        decide(lab, key, view, view["actions"][0])
    assert left(lab, key) == (0, 0, 0)


def test_who_was_erased_meanwhile_has_no_session_any_more(lab: Lab) -> None:
    key = entered(lab, SLUG)
    under_way = person(lab, key)
    with lab.database.reading() as db:
        who = erase.find_participant(db, lab, SLUG, under_way.id)
    with lab.database.writing() as db:
        erase.erase(db, who)
    with pytest.raises(NotFoundError), lab.database.writing() as db:
        leave.withdraw(db, lab, under_way, keep=False)
    with pytest.raises(NotFoundError), lab.database.writing() as db:
        watch.keep(db, lab, under_way, "visit-0004", "play:1", [(0, "blur", "", 1.0)])


def test_a_browser_that_makes_up_visits_fills_no_disk(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watch, "MOST_A_PERSON", 3)
    key = entered(lab, SLUG)
    stored = []
    for visit in range(3):
        with lab.database.writing() as db:
            who = enrol.participant_by_key(db, lab, key)
            told = [(seq, "blur", "", 1.0) for seq in range(2)]
            stored.append(watch.keep(db, lab, who, f"visit-000{visit}", "play:1", told))
    assert stored == [2, 1, 0]
