from typing import Any

import pytest

from server.domain import canonical, events
from server.domain.errors import BadInputError
from tests.fakes import timing


def test_a_timing_as_browsers_send_it_passes() -> None:
    events.check_timing(timing())
    events.check_timing(timing(wait_ms=812.25, refresh_hz=None, input="click", dropped_frames=3))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("onset_ms", -1.0),
        ("onset_ms", "1000"),
        ("onset_ms", True),
        ("response_ms", float("nan")),
        ("rt_ms", float("inf")),
        ("handler_lag_ms", None),
        ("wait_ms", 1e15),
        ("is_trusted", 1),
        ("hidden", None),
        ("resumed", "no"),
        ("refresh_hz", 0.0),
        ("dropped_frames", 1.5),
        ("dropped_frames", -1),
        ("board_px", 10**9),
        ("early_keys", True),
        ("input", "voice"),
    ],
)
def test_a_timing_that_cannot_be_is_refused_by_field(field: str, value: Any) -> None:
    with pytest.raises(BadInputError, match=f"timing.{field}"):
        events.check_timing({**timing(), field: value})


def test_a_missing_and_an_unknown_field_are_named() -> None:
    sent = dict(timing(colour="red"))
    del sent["hidden"]
    with pytest.raises(BadInputError, match="colour, hidden"):
        events.check_timing(sent)


def test_a_reaction_time_must_be_the_difference_of_its_stamps() -> None:
    with pytest.raises(BadInputError, match="rt_ms"):
        events.check_timing({**timing(), "rt_ms": 400.0})


@pytest.mark.parametrize(
    ("change", "valid"),
    [
        ({}, True),
        ({"hidden": True}, False),
        ({"resumed": True}, False),
        ({"rt_ms": -0.5, "response_ms": 999.75}, False),
    ],
)
def test_a_reaction_time_is_valid_if_nothing_came_between(change: dict[str, Any], valid: bool) -> None:
    assert events.rt_valid(timing(**change)) is valid


def test_a_digest_chains_to_all_that_came_before() -> None:
    first = events.digest("", "{}")
    assert first == canonical.sha256("{}")
    assert events.digest(first, "{}") != first
    assert events.digest(first, "{}") == canonical.sha256(first + "{}")


def test_the_same_answer_has_the_same_action_and_the_same_times() -> None:
    body = {"action": 1, "timing": dict(timing())}
    assert events.same_answer(body, 1, timing())
    assert not events.same_answer(body, 0, timing())
    assert not events.same_answer(body, 1, timing(rt_ms=412.75, response_ms=1413.0))
