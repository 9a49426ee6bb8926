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
status | string | | active; abandoned: not heard of for longer than the study's lease; or the end that was
  come to: finished, failed (too many attention checks), screened_out (by the quiz), withdrawn, timed_out,
  returned, rejected (by the marketplace).
page | string | | Page of the flow on which the participant is, or was at the end.
completion_code | string | | Code that the participant was shown at the end.
attention_failed | integer | checks | Attention checks with a wrong answer; empty if erased.
excluded | boolean | | false for who is analysed: finished, by the study's rule. The rule was frozen with the
  version.
exclusion_reason | string | | Exactly one for everybody who is excluded: incomplete (still taking part, or
  abandoned), quiz, attention, withdrawn, timed_out, returned or rejected.
won | integer | rounds | Main rounds that were won: found or arrived; empty if erased.
bonus_minor | integer | pence or cents | Bonus that the study's rule gives for them; 0 for who did not go
  through everything; empty where the study states no pay.
currency | string | | Currency of the amounts: GBP, USD or EUR.
reward_minor | integer | pence or cents | Reward that the study's rule gives for this end; empty where the
  study states no pay.
erased | boolean | | true if the person asked for deletion: no other table but flow.csv counts them.
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
outcome | string | | found or not_found (Parent & Lost Child); arrived, collision or limit (Traffic Junction);
  abandoned: left unfinished. Empty while it is being played.
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
action | integer | | Parent: 0 up, 1 right, 2 down, 3 left. Child: token_shown, the number of the chosen sign.
  Driver: 0 go, 1 brake.
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
action | integer | | Action taken then. Parent & Lost Child: 0 up, 1 right, 2 down, 3 left, 4 stay; Traffic: 0
  go, 1 brake.
cell_next | integer | cells | Cell after the action; empty if the car has left.
""")

ANSWERS = (
    *_STUDY,
    *_columns("""
arm | string | | Arm that the participant was allocated to.
form | string | | quiz, attention, probe, or the key of a questionnaire.
block | integer | | Block in or after which it was asked, from 1; 0: after all blocks.
attempt | integer | | Which try this was, from 1; only a quiz has more than one.
item | string | | Key of the question within its form.
value | string | | The answer: the option's number (from 1), the value of a scale or a number, or what was
  written; of the probe row,column of the marked cell. Empty if an optional question was left out.
label | string | | The words of the chosen option; empty where nothing was chosen from a list.
correct | boolean | | Whether the answer was right; empty where no answer is right or wrong.
first_ms | number | ms | From the drawing of the form to the first change of this answer; empty if not
  measured.
last_ms | number | ms | From the drawing of the form to the last change of this answer.
changes | integer | changes | How often the answer was changed, the first time included.
answered_utc | utc | UTC | When the server stored the form.
"""),
)

PROBE = _columns("""
participant | string | | Pseudonym of the person within hatlab.
arm | string | | Arm that the participant was allocated to.
communication | string | | What the teammates' messages are: prototype, one-hot or shuffled.
sign | integer | | Number on screen of the sign that was marked for; from 1.
position | integer | | Panel position at which that sign stood; from 0.
token | integer | | Token (index in the bundle) behind the sign; from 0.
row | integer | cells | Marked cell: row from the top; from 0.
column | integer | cells | Marked cell: column from the left; from 0.
probability | number | probability | P(cell given token) of the marked cell, by the lexicon of the arm's
  agent. This and the three that follow are empty if that very agent was not loaded at the export.
best | number | probability | The largest P(cell given token): what the best mark would have got.
distance | number | steps | Expected steps (up, down, left, right) from the marked cell to where the token is
  said.
least | number | steps | The same from the best cell that could have been marked.
""")

BROWSER_EVENTS = _columns("""
participant | string | | Pseudonym of the person within hatlab.
visit | string | | Name that a page draws when it is loaded: events of one load belong together.
seq | integer | | Event within the visit.
page | string | | Page of the flow on which it happened.
kind | string | | loaded; focus, blur; visible, hidden; resize; fullscreen, windowed: what happened to the
  window.
value | string | | What goes with it, such as the size after resize.
at_ms | number | ms | Page clock when it happened: since the page was loaded.
stored_utc | utc | UTC | When the server stored it.
""")

JOURNEY = _columns("""
participant | string | | Pseudonym of the person within hatlab.
seq | integer | | Event within the person's journey, from 1.
event | string | | What happened, as docs/journey.md names it.
state | string | | State of the person after it, likewise.
source | string | | Who said so: participant, server, or the marketplace.
stored_utc | utc | UTC | When the server stored it.
""")

FLOW = _columns("""
study | string | | Short name of the study, as in its link.
mode | string | | live, test, preview or robot.
arm | string | | Arm that is counted; empty: the whole study. Only what follows consent is counted by arm.
stage | string | | invited, declined, screened_out (device), consented, quiz_failed, withdrawn, timed_out,
  returned, rejected, abandoned, in_progress, erased (nothing else is known of them), finished,
  attention_failed, analysed. consented is the sum of the stages from quiz_failed to finished; finished is
  attention_failed and analysed together.
people | integer | people | How many. Empty: unknown, as it is for invited.
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
    "answers": ANSWERS,
    "probe": PROBE,
    "browser_events": BROWSER_EVENTS,
    "journey": JOURNEY,
    "flow": FLOW,
}
TABLE_KEYS = {
    "participants": "participant",
    "trials": "trial_id; participant joins participants.csv",
    "steps": "trial_id, seq; trial_id joins trials.csv",
    "agents": "trial_id, seq, step, seat; trial_id, seq join steps.csv",
    "answers": "participant, form, block, attempt, item; participant joins participants.csv",
    "probe": "participant, sign; participant joins participants.csv",
    "browser_events": "participant, visit, seq; participant joins participants.csv",
    "journey": "participant, seq; participant joins participants.csv",
    "flow": "mode, arm, stage",
}
TABLE_MEANINGS = {
    "participants": "One row a person who consented.",
    "trials": "One row a trial that was begun.",
    "steps": "One row a decision of the participant.",
    "agents": "One row a seat and world step, the participant's seat included.",
    "answers": "One row an answer: to quiz, attention checks, questionnaires, and the probe of the signs.",
    "probe": "One row a sign that was marked in the probe: where the person thinks that it points.",
    "browser_events": "One row an event of the participant's window.",
    "journey": "One row a thing that moved a participant from one state to another.",
    "flow": "One row a stage of the study's flow, as a CONSORT diagram counts it.",
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
counts, SHA-256 of every file, study versions, modes, flow, agents that were not loaded, time of the export).

- RFC 4180: UTF-8, CRLF, header line. An empty cell means: does not exist here. Booleans: `true` and `false`.
- A text that starts with `=`, `+`, `-`, `@`, TAB or CR is preceded by `'`, so that a spreadsheet does not run
  it. Numbers stay numbers.
- Times are UTC, ISO 8601 with milliseconds. Cells, rows, columns, seats, tokens and positions count from 0;
  trials, blocks, rounds, steps, decisions and numbers on screen from 1.
- Amounts of money are whole minor units: pence or cents.
- Worker ids of a marketplace are never exported: a person appears only as the pseudonym in `participant`.
- Rows of the modes test, preview and robot, and practice trials, are left out unless asked for
  (`hatlab export STUDY --out DIR --mode robot --practice`).
- Whoever asked for deletion has a row in participants.csv (`erased` is true), and nowhere else.
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
