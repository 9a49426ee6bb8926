"""How every figure looks: one hue for amounts, one accent for what is meant, grey for null or reference.

Units stand in axis titles, the finding in the subtitle; no legend where a label does; what differs by colour
differs by shape, dash or label too.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import altair as alt
import vl_convert

if TYPE_CHECKING:
    from pathlib import Path

Chart = Any
"""An altair chart of any kind; its classes share their methods through untyped mix-ins."""

INK, SOFT, LINE, ACCENT, ORANGE, HEAT_0, HEAT, NULL = (
    "#14181c",
    "#5f6973",
    "#dfe3e6",
    "#0b5a8f",
    "#c94c18",
    "#f1f4f6",
    "#12477a",
    "#c6ccd1",
)
SERIES = (ACCENT, ORANGE, "#5b7f2b", "#7d4e9f")
"""For up to four things of a kind, each with its own shape or dash."""
SHAPES = ("circle", "square", "triangle-up", "diamond")
DASHES = ([1, 0], [7, 4], [2, 3], [7, 3, 2, 3])
FONT = "Helvetica, Arial, 'DejaVu Sans', sans-serif"
FEW = 24
"""Up to this many tokens each is named and drawn large."""
TALL = 300
"""Height of a plot in px."""


def write(charts: dict[str, Chart], out: Path, *, png: bool = False) -> list[Path]:
    """Write each chart as SVG, and as PNG if asked; return the files."""
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for name, chart in charts.items():
        spec = styled(chart).to_dict()
        path = out / f"{name}.svg"
        path.write_text(_short(vl_convert.vegalite_to_svg(spec)) + "\n", encoding="utf-8")
        written.append(path)
        if png:
            path = out / f"{name}.png"
            path.write_bytes(vl_convert.vegalite_to_png(spec, scale=2))
            written.append(path)
    return written


def _short(svg: str) -> str:
    """The same picture with coordinates to a thousandth of a pixel."""
    return re.sub(r"\d+\.\d{4,}", lambda found: f"{float(found[0]):.3f}".rstrip("0").rstrip("."), svg)


def chart(rows: list[dict[str, Any]]) -> Chart:
    return alt.Chart(alt.Data(values=rows))  # type: ignore[no-untyped-call]


def axis(field: str, title: str, domain: tuple[float, float] | None = None) -> Any:
    scale = alt.Scale(zero=False, nice=True) if domain is None else alt.Scale(domain=list(domain), nice=False)
    kind = alt.X if field in {"x", "said", "share", "place"} else alt.Y
    return kind(f"{field}:Q", title=title, scale=scale, axis=alt.Axis(tickCount=5))


def kinds() -> alt.Color:
    return alt.Color(
        "kind:N", scale=alt.Scale(domain=["says where", "null"], range=[ACCENT, NULL]), legend=None
    )


def percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def title(text: str, subtitle: str | list[str]) -> alt.TitleParams:
    return alt.TitleParams(text, subtitle=subtitle)


def beside(*charts: Chart) -> Chart:
    """Return charts side by side, each with its own scales."""
    return alt.hconcat(*charts, spacing=36).resolve_scale(
        color="independent", shape="independent", size="independent", fill="independent"
    )


def styled(chart: Chart) -> Chart:
    styled: Chart = (
        chart.configure(font=FONT, background="white", padding=16, aria=False)
        .configure_view(stroke=None)
        .configure_axis(
            labelFontSize=12,
            titleFontSize=12,
            titleFontWeight="normal",
            titlePadding=10,
            labelColor=SOFT,
            titleColor=INK,
            gridColor=LINE,
            domainColor=LINE,
            tickColor=LINE,
        )
        .configure_title(
            anchor="start",
            fontSize=16,
            fontWeight=600,
            color=INK,
            subtitleColor=SOFT,
            subtitleFontSize=12,
            offset=14,
        )
    )
    return styled
