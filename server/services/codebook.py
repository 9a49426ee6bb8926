"""What every exported column means: one line a column, in the order of the CSV headers.

The export writes its headers from `TABLES`, a test reads them back from a real export, and
`docs/data-dictionary.md` is this module printed (`make docs`).

Types: `string` (formula-safe text), `integer`, `number`, `boolean` (`true` or `false`) and `utc` (ISO 8601,
milliseconds, `Z`). An empty cell means: does not exist here.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["CODEBOOK", "TABLES", "TABLE_KEYS", "TABLE_MEANINGS", "Column", "header", "markdown", "rows"]


class Column(NamedTuple):
    """One column: its name carries the unit last (`rt_ms`), `unit` says it again for readers."""

    name: str
    type: str
    unit: str
    meaning: str


def _columns(text: str) -> tuple[Column, ...]:
    """Read `name | type | unit | meaning` lines; a line that starts with a space goes on with the meaning."""
    lines = text.strip().replace("\n  ", " ").splitlines()
    return tuple(Column(*(cell.strip() for cell in line.split("|"))) for line in lines)


_STUDY = _columns("""
study | string | | Short name of the study, as in its link.
study_version | integer | | Launched version of the study that this participant entered; from 1.
mode | string | | live, test, preview or robot. Only live rows are exported unless others are asked for.
participant | string | | Pseudonym of the person within hatlab. Worker ids are never exported.
""")

PARTICIPANTS = (
    *_STUDY,
    *_columns("""
arm | string | | Arm that the participant was allocated to.
role_order | string | | Roles in the order of their blocks, joined by '-': parent-child or child-parent;
  driver.
token_permutation | string | | Panel position (counted from 0) of token 0, 1, 2, …, separated by spaces.
  Empty where the study has no panel.
number_permutation | string | | Number shown on screen at panel position 0, 1, 2, …, separated by spaces.
  Empty where the study has no panel.
allocation_probability | number | | Probability with which the allocation gave this arm and role order.
allocation_seed | integer | | Seed of the allocation's draw, for re-randomisation tests.
allocated_utc | utc | UTC | When the allocation was made.
marketplace | string | | prolific, mturk, list (a personal link of the lab's own list) or direct.
device | string | | Device class that the browser reported at consent.
browser | string | | Browser family and system that the browser reported at consent.
viewport | string | CSS px | Inner size of the window at consent, width x height.
consent_version | string | | Version of the consent text that was agreed to.
consent_text_sha256 | string | | Hash of the consent text that was agreed to.
consented_utc | utc | UTC | When consent was stored.
last_seen_utc | utc | UTC | When the server last heard from this participant.
finished_utc | utc | UTC | When the last page was reached; empty if it was not.
status | string | | active, finished, or abandoned: not heard of for longer than the study's lease.
page | string | | Page of the flow on which the participant is.
completion_code | string | | Code that the participant was shown at the end.
"""),
)

TRIALS = (
    *_STUDY,
    *_columns("""
arm | string | | Arm that the participant was allocated to.
phase | string | | practice or main. Practice is left out unless asked for.
task | string | | parent_child or traffic_junction.
task_version | integer | | Version of the world's rules.
block | integer | | Block within the session, from 1.
role | string | | parent, child or driver: what the participant was in this trial.
trial | integer | | Trial within the role and phase, from 1.
round | integer | | Ordinal over the whole session, practice included, from 1.
trial_id | string | | Key of the trial: participant, '-', round.
situation | integer | | Which of the study's situations this was. All arms play the same ones; the order is
  drawn per participant.
communication | string | | What the teammates' messages are: prototype, one-hot, shuffled …; empty in
  practice.
budget | number | | Message budget b of the teammates: aimed share of agent-steps with a message.
overlay | boolean | | Whether the caution overlay was switched on.
bundle | string | | Released policy that held the other seats; empty with scripted teammates.
bundle_sha256 | string | | Hash of that policy's manifest, which names the hash of every file.
scripted | string | | Scripted teammate (practice); empty with a trained policy.
seed | integer | | Seed of the situation: the world replays from it.
started_utc | utc | UTC | When the server stored event 0.
ended_utc | utc | UTC | When the server stored the last event; empty while unfinished.
outcome | string | | found or not_found (Parent & Lost Child); arrived, collision or limit (Traffic
  Junction); abandoned: left unfinished. Empty while it is being played.
success | boolean | | true if outcome is found or arrived; empty while it is being played.
steps | integer | steps | Steps of the parent, 20 if not found (parent and child role); own decisions
  (driver).
progress | integer | cells | Cells that the participant's car advanced before the end; arrival counts
  route_length. Driver only.
route_length | integer | cells | Cells on the participant's route. Driver only.
cars_at_entry | integer | cars | Cars driving when the participant entered, their own not counted. Driver
  only.
token | integer | | Token (index in the bundle) sent in this trial, by agent or participant; from 0.
token_shown | integer | | Number on screen of that token; from 1. Empty with blank signs.
position | integer | | Panel position at which that token stood; from 0.
decisions | integer | | Rows of this trial in steps.csv.
rt_valid_count | integer | | Decisions whose reaction time is valid.
rt_ms_mean | number | ms | Mean reaction time over the valid decisions.
rt_ms_median | number | ms | Median reaction time over the valid decisions.
"""),
)

STEPS = _columns("""
participant | string | | Pseudonym of the person within hatlab.
trial_id | string | | Key of the trial in trials.csv.
seq | integer | | Decision within the trial, from 1. What was shown before it was stored with event seq - 1.
phase | string | | practice or main.
role | string | | parent, child or driver.
action | integer | | Parent: 0 up, 1 right, 2 down, 3 left. Child: token_shown, the number of the chosen
  sign. Driver: 0 go, 1 brake.
action_name | string | | The same as a word: up, right, down, left; sign; go, brake.
rt_ms | number | ms | Reaction time: response_ms - onset_ms. Holds no network time.
rt_valid | boolean | | true if the page was never hidden, not resumed after a reload, and rt_ms ≥ 0.
onset_ms | number | ms | Page clock when the state was drawn (inside an animation frame).
response_ms | number | ms | Page clock of the key or click: the event's own time stamp.
handler_lag_ms | number | ms | From that stamp to the handler: how busy the page was.
wait_ms | number | ms | From the previous response to this onset: the wait for the answer.
is_trusted | boolean | | false if a script made the key press or click.
hidden | boolean | | true if the page was hidden between onset and response.
resumed | boolean | | true if this state was first drawn before a reload or in another tab.
refresh_hz | number | Hz | Estimated refresh rate of the screen.
dropped_frames | integer | frames | Animation frames missed between onset and response.
board_px | integer | CSS px | Side of the board on screen: part of the stimulus.
early_keys | integer | key presses | Key presses before the onset; dropped.
input | string | | What the decision was made with: key or click.
row | integer | cells | Own cell when deciding: row from the top; from 0.
col | integer | cells | Own cell when deciding: column from the left; from 0.
messages_heard | integer | messages | Open gates of others at this step, null tokens included.
messages_drawn | integer | messages | Messages of these that put something on the screen.
triangle_max | number | probability | Likelihood of the largest triangle on the screen. Driver only.
stored_utc | utc | UTC | When the server stored the decision.
""")

AGENTS = _columns("""
trial_id | string | | Key of the trial in trials.csv.
seq | integer | | Decision in steps.csv that caused this world step.
step | integer | | World step within the trial since the participant entered, from 1.
seat | integer | | Place in the world, from 0. Empty places have no row.
is_participant | boolean | | true in the participant's own seat.
source | string | | Who spoke for this seat: policy, scripted, human (child role), or ghost: the policy that
  speaks for the participant while the participant acts.
cell | integer | cells | Cell before the action: row x columns + column; from 0.
token | integer | | Token (index in the bundle) said in that state; empty if the seat said nothing.
gate | boolean | | true if the message was sent.
action | integer | | Action taken then. Parent & Lost Child: 0 up, 1 right, 2 down, 3 left, 4 stay; Traffic:
  0 go, 1 brake.
cell_next | integer | cells | Cell after the action; empty if the car has left.
""")

CODEBOOK = _columns("""
table | string | | Name of the file without its ending.
column | string | | Name of the column.
type | string | | string, integer, number, boolean or utc.
unit | string | | Unit, where there is one.
meaning | string | | What a value says.
""")

TABLES: dict[str, tuple[Column, ...]] = {
    "participants": PARTICIPANTS,
    "trials": TRIALS,
    "steps": STEPS,
    "agents": AGENTS,
}
TABLE_KEYS = {
    "participants": "participant",
    "trials": "trial_id; participant joins participants.csv",
    "steps": "trial_id, seq; trial_id joins trials.csv",
    "agents": "trial_id, seq, step, seat; trial_id, seq join steps.csv",
}
TABLE_MEANINGS = {
    "participants": "One row a person who consented.",
    "trials": "One row a trial that was begun.",
    "steps": "One row a decision of the participant.",
    "agents": "One row a seat and world step, the participant's seat included.",
}


def header(table: str) -> list[str]:
    """Give the column names of a table (`codebook` included), in the order of the file."""
    return [column.name for column in ({**TABLES, "codebook": CODEBOOK}[table])]


def rows() -> Iterator[tuple[str, ...]]:
    """Yield codebook.csv: table, column, type, unit, meaning."""
    for table, columns in TABLES.items():
        for column in columns:
            yield (table, *column)


_PREFACE = """# Data dictionary

This page is printed by `python -m server.services.codebook`, the module from which the export takes its
headers. An export holds these tables as CSV, `codebook.csv` (this page as a table) and `manifest.json` (row
counts, SHA-256 of every file, study versions, modes, time of the export).

- RFC 4180: UTF-8, CRLF, header line. An empty cell means: does not exist here. Booleans: `true` and `false`.
- A text that starts with `=`, `+`, `-`, `@`, TAB or CR is preceded by `'`, so that a spreadsheet does not run
  it. Numbers stay numbers.
- Times are UTC, ISO 8601 with milliseconds. Cells, rows, columns, seats, tokens and positions count from 0;
  trials, blocks, rounds, steps, decisions and numbers on screen from 1.
- Worker ids of a marketplace are never exported: a person appears only as the pseudonym in `participant`.
- Rows of the modes test, preview and robot, and practice trials, are left out unless asked for
  (`hatlab export STUDY --out DIR --mode robot --practice`).
- All tables of one export are read in one transaction, and rows are ordered by their key.
"""


def _section(table: str) -> Iterator[str]:
    yield f"\n## {table}.csv\n\n{TABLE_MEANINGS[table]} Key: {TABLE_KEYS[table]}.\n\n"
    yield "| column | type | unit | meaning |\n|---|---|---|---|\n"
    for column in TABLES[table]:
        yield f"| `{column.name}` | {column.type} | {column.unit} | {column.meaning} |\n"


def markdown() -> str:
    """Give docs/data-dictionary.md."""
    return _PREFACE + "".join(line for table in TABLES for line in _section(table))


if __name__ == "__main__":
    sys.stdout.write(markdown())
