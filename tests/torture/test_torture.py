"""A small kill test in every test run; the large one is `make torture`."""

import warnings
from pathlib import Path

import pytest

from benchmarks import measurements
from benchmarks.served import DatabaseName
from server.simulate.robot import Step
from tests.torture.torture import Ordeal, Report, compare, torture


@pytest.mark.parametrize("database", ["sqlite", pytest.param("postgresql", marks=pytest.mark.postgres)])
def test_nothing_acknowledged_is_lost_when_the_server_is_killed(database: DatabaseName) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the wheel that starts PostgreSQL
        report = torture(Ordeal(database, kills=3, robots=6, trials_per_block=2, steps_between=(5, 25)))
    assert report.errors == ()
    assert (report.missing, report.doubled, report.unknown, report.stale) == (0, 0, 0, 0)
    assert report.verify_exit == 0, report.verify_said
    assert report.sent_again > 0
    assert report.clean


def judged(journal: list[Step], log: list[Step]) -> tuple[int, int, int]:
    report = Report(Ordeal("sqlite", 0, 1, 1, (1, 1)), 1)
    compare(journal, log, report)
    return report.missing, report.doubled, report.unknown


def test_the_judge_sees_what_is_missing_doubled_changed_or_made_up() -> None:
    steps = [Step(1, seq, 0) for seq in (1, 2, 3)]
    assert judged(steps, steps) == (0, 0, 0)
    assert judged(steps, steps[:2]) == (1, 0, 0)
    assert judged(steps, [*steps, steps[0]]) == (0, 1, 1)
    assert judged(steps, [*steps[:2], Step(1, 3, 1)]) == (1, 0, 1)
    assert judged(steps, [*steps, Step(1, 4, 0)]) == (0, 0, 1)


def test_a_record_replaces_its_own_section_only(tmp_path: Path) -> None:
    path = tmp_path / "measurements.md"
    measurements.record("make one", "sooner", path)
    measurements.record("make two", "second", path)
    measurements.record("make one", "again", path)
    text = path.read_text()
    assert text.startswith(measurements.HEAD)
    assert "sooner" not in text
    assert (
        text.index("## `make one`") < text.index("again") < text.index("## `make two`") < text.index("second")
    )
