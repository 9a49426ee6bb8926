"""Rows say what happened, and when: what was shown before a decision, and that decision's own timing."""

import csv
import io
from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest

from benchmarks import synthetic
from server.domain.plan import Round
from server.domain.study import read
from server.services import codebook, studies, tidy, tracks
from server.services.sheets import Sheet

STEP, TRIAL, AGENT = (codebook.header(table) for table in ("steps", "trials", "agents"))
PERSON = {"id": "PA", "study_version": 2, "mode": "live", "arm": "one-hot"}


def played(role: str, *, phase: str = "main", seed: int = 11) -> synthetic.Played:
    study = read(studies.template("traffic-junction" if role == "driver" else "parent-child"))
    planned = Round(5, 1, phase, role, 3, 20, 7, seed, False)  # type: ignore[arg-type]
    return synthetic.play(synthetic.spec_of(study, planned), planned, Random(seed))


def told(one: synthetic.Played, **changes: Any) -> tidy.Story:
    trial = {
        "id": "PA-005",
        "participant_id": "PA",
        "round": 5,
        "block": 1,
        "number": 3,
        "situation": 7,
        "phase": one.round.phase,
        "role": one.round.role,
        "seed": one.round.seed,
        "arm": "one-hot",
        "outcome": one.trial.outcome,
        "steps": one.trial.step,
        "progress": one.trial.progress,
        "started_utc": "a",
        "ended_utc": "b",
    }
    events = [(seq, body, f"utc{seq}") for seq, body in enumerate(one.bodies)]
    return tidy.story({**trial, **changes}, events)


def steps_of(story: tidy.Story) -> list[dict[str, Any]]:
    return [dict(zip(STEP, row, strict=True)) for row in tidy.step_rows(story)]


def trial_of(story: tidy.Story, *, left: bool = False) -> dict[str, Any]:
    entry = tracks.entries([story])[0]
    return dict(zip(TRIAL, tidy.trial_row("demo", PERSON, story, entry, left=left), strict=True))


def agents_of(story: tidy.Story) -> list[dict[str, Any]]:
    track = tracks.tracks([story])[0]
    return [dict(zip(AGENT, row, strict=True)) for row in tidy.agent_rows(story, track)]


@pytest.mark.parametrize("role", ["parent", "child", "driver"])
def test_a_step_tells_what_was_shown_before_it_and_its_own_timing(role: str) -> None:
    one = played(role)
    rows = steps_of(told(one))
    assert len(rows) == len(one.bodies) - 1
    for seq, row in enumerate(rows, start=1):
        shown, decision = one.bodies[seq - 1]["saw"], one.bodies[seq]
        assert row["seq"] == seq
        assert (row["row"], row["col"]) == (shown["row"], shown["col"])
        for name in ("messages_heard", "messages_drawn", "triangle_max"):
            assert row[name] == shown[name]
        for name in (
            "rt_ms",
            "onset_ms",
            "response_ms",
            "handler_lag_ms",
            "wait_ms",
            "refresh_hz",
            "board_px",
        ):
            assert row[name] == decision["timing"][name]
        assert row["action"] == decision["action"]
        assert row["stored_utc"] == f"utc{seq}"


def test_the_first_row_of_a_parent_is_the_start_cell_and_not_the_next() -> None:
    one = played("parent")
    first = steps_of(told(one))[0]
    assert [first["row"], first["col"]] == list(divmod(one.trial.trail[0], 9))


def test_a_childs_step_is_the_number_that_it_chose() -> None:
    one = played("child")
    [row] = steps_of(told(one))
    trial = trial_of(told(one))
    assert row["action"] == trial["token_shown"] == one.bodies[1]["action"]
    assert row["action_name"] == "sign"
    assert trial["token"] == one.bodies[1]["token"]
    assert trial["position"] == synthetic.PANEL.position_of_token[trial["token"]]
    assert trial["decisions"] == 1


def test_a_parents_trial_holds_the_token_that_the_child_sent() -> None:
    one = played("parent")
    trial = trial_of(told(one))
    assert trial["token"] == one.bodies[0]["tokens"][1]
    assert trial["token_shown"] == synthetic.PANEL.number_of(trial["token"])
    assert (trial["progress"], trial["route_length"], trial["cars_at_entry"]) == (None, None, None)


def test_a_drivers_trial_holds_the_route_and_the_cars_that_were_met() -> None:
    one = played("driver")
    trial = trial_of(told(one))
    assert trial["route_length"] == len(one.trial.route)
    assert trial["cars_at_entry"] == one.bodies[0]["tokens"].count(-1) * -1 + 9
    assert 5 <= trial["cars_at_entry"] <= 9
    assert trial["progress"] == one.trial.progress
    assert (trial["token"], trial["token_shown"], trial["position"]) == (None, None, None)


@pytest.mark.parametrize(
    ("outcome", "success"),
    [
        ("found", "true"),
        ("arrived", "true"),
        ("collision", "false"),
        ("limit", "false"),
        ("not_found", "false"),
    ],
)
def test_success_follows_from_the_outcome(outcome: str, success: str) -> None:
    assert trial_of(told(played("parent"), outcome=outcome))["success"] == success


def test_an_unfinished_trial_is_abandoned_only_once_its_person_has_left() -> None:
    open_trial = told(played("parent"), outcome=None, ended_utc=None)
    assert trial_of(open_trial)["outcome"] is None
    gone = trial_of(open_trial, left=True)
    assert gone["outcome"] == "abandoned"
    assert gone["success"] is None
    assert trial_of(told(played("parent"), outcome="found"), left=True)["outcome"] == "found"


def test_a_trial_without_a_decision_yet_has_no_reaction_time() -> None:
    one = played("parent")
    trial = trial_of(told(one._replace(bodies=one.bodies[:1]), outcome=None))
    assert (trial["decisions"], trial["rt_valid_count"]) == (0, 0)
    assert (trial["rt_ms_mean"], trial["rt_ms_median"]) == (None, None)


def timed(story: tidy.Story, *timings: dict[str, Any]) -> tidy.Story:
    decisions = [
        d._replace(body={**d.body, "timing": {**d.body["timing"], **timing}})
        for d, timing in zip(story.decisions, timings, strict=False)
    ]
    return replace(story, decisions=tuple(decisions))


def test_mean_and_median_leave_out_what_is_no_reaction_time() -> None:
    story = timed(
        told(played("parent")),
        {"rt_ms": 100.0},
        {"rt_ms": 200.0},
        {"rt_ms": 600.0},
        {"rt_ms": 9_000.0, "hidden": True},
        {"rt_ms": 9_000.0, "resumed": True},
        {"rt_ms": -5.0},
    )
    trial = trial_of(story)
    assert (trial["rt_valid_count"], trial["rt_ms_mean"], trial["rt_ms_median"]) == (3, 300.0, 200.0)
    assert [row["rt_valid"] for row in steps_of(story)] == ["true"] * 3 + ["false"] * 3


def test_blank_signs_of_practice_have_no_number() -> None:
    trial = trial_of(told(played("parent", phase="practice")))
    assert trial["token"] is not None
    assert trial["token_shown"] is None
    assert (trial["communication"], trial["bundle"], trial["scripted"]) == (None, None, "seeker")


def test_the_participants_seat_is_marked_as_spoken_for_by_the_ghost() -> None:
    rows = agents_of(told(played("driver")))
    own = [row for row in rows if row["is_participant"] == "true"]
    assert {row["seat"] for row in own} == {9}
    assert {row["source"] for row in own} == {"ghost"}
    assert {row["source"] for row in rows if row["seat"] != 9} == {"policy"}
    assert all(row["token"] is not None for row in own)


def test_a_child_speaks_for_itself_and_the_parent_hears_it_at_every_step() -> None:
    one = played("child")
    rows = agents_of(told(one))
    own = [row for row in rows if row["seat"] == 1]
    assert {row["source"] for row in own} == {"human"}
    assert {(row["token"], row["gate"]) for row in own} == {(one.bodies[1]["token"], "true")}
    assert [row["step"] for row in own] == list(range(1, one.trial.step + 1))
    assert {row["seq"] for row in rows} == {1}


@pytest.mark.parametrize("role", ["parent", "child"])
def test_agents_hold_the_parents_whole_walk(role: str) -> None:
    one = played(role)
    walk = [row for row in agents_of(told(one)) if row["seat"] == 0]
    assert [row["cell"] for row in walk] == list(one.trial.trail[:-1])
    assert [row["cell_next"] for row in walk] == list(one.trial.trail[1:])


@pytest.mark.parametrize("seed", range(6))
def test_a_drivers_agents_are_the_messages_and_actions_of_the_log(seed: int) -> None:
    one = played("driver", seed=seed)
    rows = agents_of(told(one))
    assert len({(row["seq"], row["step"], row["seat"]) for row in rows}) == len(rows)
    for row in rows:
        before, after = one.bodies[row["seq"] - 1], one.bodies[row["seq"]]
        said = before if row["seq"] == 1 else before["moves"][-1]
        assert row["token"] == said["tokens"][row["seat"]]
        assert row["gate"] == tidy.FLAG[said["gates"][row["seat"]]]
        assert row["action"] == after["moves"][0]["actions"][row["seat"]]
        assert row["step"] == row["seq"]


def test_a_car_that_leaves_has_no_next_cell_even_if_its_seat_is_taken_at_once() -> None:
    ended = [agents_of(told(played("driver", seed=seed))) for seed in range(12)]
    last_of_arrivals = [
        [row for row in rows if row["is_participant"] == "true"][-1]
        for rows, seed in zip(ended, range(12), strict=True)
        if played("driver", seed=seed).trial.outcome == "arrived"
    ]
    assert last_of_arrivals
    assert {row["cell_next"] for row in last_of_arrivals} == {None}


def test_side_by_side_replay_is_replay_one_by_one() -> None:
    stories = [told(played(role, seed=seed)) for seed in range(4) for role in ("parent", "driver", "child")]
    together, alone = tracks.tracks(stories), [tracks.tracks([story])[0] for story in stories]
    for one, other in zip(together, alone, strict=True):
        np.testing.assert_array_equal(one.before, other.before)
        np.testing.assert_array_equal(one.after, other.after)
    assert tracks.entries(stories) == [tracks.entries([story])[0] for story in stories]


def test_permutations_are_written_as_numbers_between_spaces() -> None:
    assert tidy.permutation("[3,0,2,1]") == "3 0 2 1"
    assert tidy.permutation("[]") is tidy.permutation("") is tidy.permutation(None) is None


def cells(table: str, *rows: tuple[Any, ...]) -> list[list[str]]:
    text = b"".join(Sheet(table).pieces(rows)).decode()
    assert text.endswith("\r\n")
    return list(csv.reader(io.StringIO(text, newline="")))


@pytest.mark.parametrize("start", ["=", "+", "-", "@", "\t", "\r"])
def test_a_text_that_a_spreadsheet_would_run_is_made_harmless(start: str) -> None:
    table = cells("codebook", ("t", f"{start}cmd", "string", "", 'a, "quoted"\nmeaning'))
    assert table[1] == ["t", f"'{start}cmd", "string", "", 'a, "quoted"\nmeaning']


def test_numbers_stay_numbers_and_nothing_stays_empty() -> None:
    width = len(AGENT)
    row = ["P-1", *[None] * (width - 1)]
    row[AGENT.index("cell")] = -1
    written = cells("agents", tuple(row))[1]
    assert written[AGENT.index("cell")] == "-1"
    assert written[AGENT.index("token")] == ""
