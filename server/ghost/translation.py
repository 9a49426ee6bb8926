"""What reaches a participant's screen of everything that was said: where messages become pictures."""

from models.policies.lexicon import Lexicon
from models.vocabulary import SILENT
from server.domain.events import Said
from server.domain.trial import Trial
from server.domain.view import Heard
from server.ghost import overlay


def translate(trial: Trial, lexicon: Lexicon | None) -> Heard:
    """Translate what was said in the present state for the participant.

    Args:
        trial: the trial, with its `said`.
        lexicon: of the bundle in the other seats; None in practice.
    """
    return on_the_road(trial, lexicon) if trial.spec.role == "driver" else on_the_panel(trial)


def on_the_panel(trial: Trial) -> Heard:
    """The sign that the child sent: heard by the parent, or the child's own choice."""
    panel, condition = trial.spec.condition.panel, trial.spec.condition
    token = held_token(trial)
    if panel is None or token is None:
        return Heard()
    number = panel.number_of(token)
    if trial.spec.role == "child":
        return Heard(sign=number)
    heard = 0 if trial.over else 1
    return Heard(heard, heard, number) if condition.overlay else Heard(heard)


def held_token(trial: Trial) -> int | None:
    """The child's sign; it stays highlighted when the round is over."""
    if trial.held is None:
        return None
    return next((token for token in trial.held.tokens if token != SILENT), None)


def on_the_road(trial: Trial, lexicon: Lexicon | None) -> Heard:
    if not trial.spec.condition.overlay:
        return Heard(messages=sum(others(trial).gates))
    if lexicon is None:
        return Heard(triangles=() if trial.over else overlay.examples(trial), overlay=True)
    heard = others(trial)
    return Heard(
        messages=sum(heard.gates),
        drawn=overlay.messages_drawn(lexicon, heard.tokens, heard.gates),
        triangles=overlay.triangles(lexicon, heard.tokens, heard.gates, trial.cell, trial.env.shape[1]),
        overlay=True,
    )


def others(trial: Trial) -> Said:
    """What the participant's seat hears: everything but its own."""
    own = trial.spec.seat
    tokens, gates = trial.said
    return Said(
        (*tokens[:own], SILENT, *tokens[own + 1 :]),
        (*gates[:own], False, *gates[own + 1 :]),
    )
