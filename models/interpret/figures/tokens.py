"""How often tokens are said, and what they tell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import altair as alt
import numpy as np

from models.interpret.figures.style import (
    ACCENT,
    FEW,
    INK,
    ORANGE,
    SHAPES,
    SOFT,
    TALL,
    Chart,
    chart,
    kinds,
    percent,
    title,
)
from models.interpret.nulls import THRESHOLDS, information, sensitivity
from models.interpret.nulls import kinds as kinds_of
from models.policies.lexicon import NULL_RATIO

if TYPE_CHECKING:
    from models.policies.lexicon import Lexicon


def token_use(lexicon: Lexicon) -> Chart:
    """Draw how often each token was said, by index if they are few, else most used first."""
    info = information(lexicon)
    order = range(lexicon.tokens) if lexicon.tokens <= FEW else np.argsort(-lexicon.uses, kind="stable")
    rows = [
        {
            "place": place,
            "token": str(int(token)),
            "share": float(info.share[token]),
            "kind": "null" if lexicon.null[token] else "says where",
        }
        for place, token in enumerate(order)
        if lexicon.tokens <= FEW or lexicon.uses[token] > 0
    ]
    bars = (
        chart(rows)
        .mark_bar()
        .encode(
            x=alt.X(
                "token:N",
                sort=[str(row["token"]) for row in rows],
                title="token",
                axis=alt.Axis(
                    labelAngle=0, labelOverlap=False, labelFontSize=12 if lexicon.tokens <= FEW else 9
                ),
            ),
            y=alt.Y("share:Q", title="share of messages", axis=alt.Axis(format="%")),
            color=kinds(),
        )
    )
    even = chart([{"even": 1 / lexicon.tokens}]).mark_rule(color=SOFT, strokeDash=[4, 4]).encode(y="even:Q")
    used = int((lexicon.uses > 0).sum())
    subtitle = (
        f"{used} of {lexicon.tokens} tokens said in {lexicon.samples:,} messages; "
        f"dashed: an even share; null tokens carry {percent(info.null_messages)}"
    )
    return (bars + even).properties(
        width=max(420, 19 * len(rows)), height=220, title=title("Token use", subtitle)
    )


def null_tokens(lexicon: Lexicon) -> Chart:
    """Draw what each token tells about its speaker's place, against the limit below which it is null."""
    info = information(lexicon)
    rows = [
        {
            "share": float(info.share[token]),
            "told": float(info.told_bits[token]),
            "token": str(token),
            "kind": "null" if lexicon.null[token] else "says where",
        }
        for token in range(lexicon.tokens)
        if lexicon.uses[token] > 0
    ]
    base = chart(rows).encode(
        x=alt.X("share:Q", title="share of messages", axis=alt.Axis(format="%"), scale=alt.Scale(zero=True)),
        y=alt.Y(
            "told:Q",
            title="information about the cell (bits)",
            scale=alt.Scale(domain=[0, 1.08 * max(info.prior_bits, float(info.told_bits.max()), 0.1)]),
        ),
    )
    dots = base.mark_circle(size=90, opacity=0.85).encode(color=kinds())
    few = [row for row in rows if lexicon.tokens <= FEW]
    names = (
        chart(few)
        .mark_text(dx=9, align="left", fontSize=11, color=INK)
        .encode(x="share:Q", y="told:Q", text="token:N")
    )
    limits = [
        {"bits": info.needed_bits, "text": "null below this: 0.1 · H(cell)"},
        {"bits": info.prior_bits, "text": "H(cell): the whole place, on average"},
    ]
    rules = chart(limits).encode(y="bits:Q")
    lines = rules.mark_rule(color=SOFT, strokeDash=[4, 4])
    said = rules.mark_text(align="left", dy=-7, dx=4, color=SOFT, fontSize=11).encode(
        text="text:N", x=alt.value(0)
    )
    subtitle = (
        f"{int(lexicon.null.sum())} of {lexicon.tokens} tokens are null and carry "
        f"{percent(info.null_messages)} of the messages; mean information {info.mutual_bits:.2f} bits"
    )
    return (lines + said + dots + names).properties(
        width=420, height=TALL, title=title("What each token tells", subtitle)
    )


def null_threshold(lexicon: Lexicon) -> Chart:
    """Draw how many tokens and messages are null as the threshold moves."""
    names = ("messages", "tokens")
    rows = [
        {"threshold": row.threshold, "null": share, "of": name}
        for row in sensitivity(lexicon)
        for name, share in zip(names, (row.messages, row.tokens / lexicon.tokens), strict=True)
    ]
    legend = alt.Legend(title=None, orient="top", labelFontSize=12, symbolSize=90)
    base = chart(rows).encode(
        x=alt.X(
            "threshold:Q",
            title="a token is null below this share of H(cell)",
            axis=alt.Axis(values=list(THRESHOLDS)),
        ),
        y=alt.Y(
            "null:Q", title="share that is null", axis=alt.Axis(format="%"), scale=alt.Scale(domain=[0, 1])
        ),
        color=alt.Color("of:N", scale=alt.Scale(domain=names, range=[ACCENT, ORANGE]), legend=legend),
        shape=alt.Shape("of:N", scale=alt.Scale(domain=names, range=SHAPES[:2]), legend=legend),
    )
    chosen = (
        chart([{"threshold": NULL_RATIO}]).mark_rule(color=SOFT, strokeDash=[4, 4]).encode(x="threshold:Q")
    )
    why = kinds_of(lexicon)
    subtitle = (
        f"dashed: the threshold in use; {why.never_said} tokens never said, {why.rare} too rarely, "
        f"{why.vague} vague, {why.telling} say where"
    )
    marks = base.mark_line(strokeWidth=2) + base.mark_point(filled=True, size=70, opacity=1)
    return (chosen + marks).properties(
        width=420, height=TALL, title=title("How much hangs on the threshold of null?", subtitle)
    )
