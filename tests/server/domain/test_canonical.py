from datetime import UTC, datetime, timedelta, timezone

import pytest

from server.domain import canonical


def test_equal_values_have_equal_texts_whatever_the_order_of_their_keys() -> None:
    assert canonical.dumps({"b": 1, "a": [1.5, None, True]}) == '{"a":[1.5,null,true],"b":1}'
    assert canonical.dumps({"a": 1, "b": 2}) == canonical.dumps({"b": 2, "a": 1})


@pytest.mark.parametrize("number", [float("nan"), float("inf"), float("-inf")])
def test_numbers_that_json_does_not_know_are_refused(number: float) -> None:
    with pytest.raises(ValueError):
        canonical.dumps({"rt_ms": number})


def test_times_are_utc_with_milliseconds_and_sort_as_text() -> None:
    east = timezone(timedelta(hours=2))
    moment = datetime(2026, 11, 24, 1, 2, 3, 4_999, tzinfo=east)
    assert canonical.utc_text(moment) == "2026-11-23T23:02:03.004Z"
    later = moment.astimezone(UTC) + timedelta(milliseconds=1)
    assert canonical.utc_text(moment) < canonical.utc_text(later)
    assert canonical.minutes_before(moment, 2.5) == "2026-11-23T22:59:33.004Z"
    assert canonical.utc_text(canonical.utc_moment("2026-11-23T23:02:03.004Z")) == "2026-11-23T23:02:03.004Z"
