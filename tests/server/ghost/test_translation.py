"""What reaches the screen: the parent's sign, the child's own choice."""

from dataclasses import replace

from server.domain import events, trial
from server.domain.view import saw
from server.ghost.translation import translate
from tests.server.domain.test_trial import PANEL, begin, walk


def test_a_parent_sees_the_number_of_the_token_that_was_sent() -> None:
    heard = translate(begin("parent"), None)
    assert (heard.messages, heard.drawn, heard.sign) == (1, 1, PANEL.number_of(4))
    assert heard.triangles == ()


def test_the_sign_stays_for_the_whole_trial_and_at_its_end_but_is_not_heard_again() -> None:
    now = begin("parent")
    walked = walk(now, [4, 4])
    assert translate(walked, None) == translate(now, None)
    end = walk(now, [4] * 20)
    assert translate(end, None).sign == translate(now, None).sign
    assert translate(end, None).messages == 0


def test_without_the_overlay_a_parent_hears_but_sees_no_sign() -> None:
    heard = translate(begin("parent", overlay=False), None)
    assert (heard.messages, heard.drawn, heard.sign) == (1, 0, None)


def test_a_child_sees_no_sign_before_its_choice_and_its_own_after() -> None:
    now = begin("child")
    assert translate(now, None).sign is None
    chosen = trial.chosen(now, PANEL.token_of(7))
    assert translate(chosen, None).sign == 7
    assert translate(chosen, None).messages == 0


def test_the_log_keeps_the_numbers_that_were_on_the_screen() -> None:
    now = begin("parent")
    kept = saw(now, translate(now, None))
    assert [kept.row, kept.col] == list(divmod(now.cell, 9))
    assert (kept.messages_heard, kept.messages_drawn, kept.triangle_max) == (1, 1, None)
    assert kept.sign == PANEL.number_of(4)
    quiet = replace(now, held=None, said=events.silence(2))
    assert saw(quiet, translate(quiet, None)).sign is None
