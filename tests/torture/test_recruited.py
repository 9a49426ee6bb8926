"""A small form of the ordeal by marketplace in every test run; the large one is `make torture`."""

import warnings

import pytest

from tests.torture.recruited import Ordeal, ordeal_by_marketplace


@pytest.mark.postgres
def test_everybody_is_paid_exactly_once_while_the_server_is_killed() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the wheel that starts PostgreSQL
        report, settled = ordeal_by_marketplace(
            Ordeal(
                "postgresql",
                kills=3,
                finishing={"traffic-junction": 10, "parent-child": 7},
                dropouts=8,
                trials_per_block=1,
                steps_between=(20, 60),
                concurrency=12,
            )
        )
    assert report.errors == ()
    assert (report.missing, report.doubled, report.unknown, report.stale) == (0, 0, 0, 0)
    assert report.kills == 3
    assert report.participants == 25
    assert settled.wrong == []
    assert settled.left_to_do == 0
    assert settled.statuses["finished"] == 17
    assert settled.statuses["active"] == 0
    assert report.verify_exit == 0, report.verify_said
