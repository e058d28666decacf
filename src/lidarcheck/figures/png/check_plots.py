"""Small plots as inline SVG. Only this module and `figure_png` import matplotlib.

Colours are those of the page, so that they follow its light or dark mode: matplotlib draws with stand-ins, which are
replaced by the page's CSS variables. The same numbers give the same bytes.
"""

from __future__ import annotations

import contextlib
import html
import io
import math
import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from lidarcheck.harness.reports.results import KpiResult
from lidarcheck.printable import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Pen", "drawing"]

_INK, _MUTED, _BAND, _OLD, _NEW = "#010203", "#020304", "#030405", "#040506", "#050607"
_VARIABLES = {_INK: "--ink", _MUTED: "--muted", _BAND: "--band", _OLD: "--old", _NEW: "--new"}
_WIDTH_IN, _HEIGHT_IN = 3.0, 1.6
_AXES = (0.2, 0.17, 0.74, 0.78)
_STYLE: Any = {
    "axes.edgecolor": _MUTED,
    "axes.formatter.useoffset": False,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "figure.dpi": 72,
    "font.size": 8.0,
    "path.simplify": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "lidarcheck",
    "text.color": _INK,
    "text.parse_math": False,
    "xtick.color": _MUTED,
    "xtick.labelcolor": _INK,
    "ytick.color": _MUTED,
    "ytick.labelcolor": _INK,
}
_FONT = re.compile(r"font-family: [^;\"]*")
_LONG_NUMBER = re.compile(r"(?<=[ \"(])-?\d+\.\d{2,}")
_OPENING = re.compile(r"<svg [^>]*>")
_NEEDLESS = re.compile(
    r"<metadata>.*?</metadata>|<style.*?</style>|<defs>\s*</defs>| transform=\"rotate\(-0 [^\"]*\""
    r"| id=\"(?:figure|axes|patch|line2d|text|[xy]tick|matplotlib\.axis)_\d+\"|xlink:(?=href)",
    re.DOTALL,
)
_EMPTY_GROUP = re.compile(r"<g/>|<g>\s*</g>")
_ID = re.compile(r'(\bid="|href="#|url\(#)')


@contextlib.contextmanager
def drawing() -> Iterator[Pen]:
    """A pen, with matplotlib's settings the same for everybody until the block ends."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield Pen()


class Pen:
    """Draws one plot after the other; every identifier in their SVG is unique on the page."""

    def __init__(self) -> None:
        self._plots = 0

    def seeds(self, kpi: KpiResult) -> str:
        """The KPI of each seed, golden and now, paired seeds first; the band is the golden's mean ± tolerance.

        Empty if no seed of either gave a value.
        """
        old, new, fresh = kpi.old_paired, kpi.paired, kpi.fresh
        if not any(map(math.isfinite, (*old, *new, *fresh))):
            return ""
        figure, axes = self._axes()
        if math.isfinite(kpi.old):
            axes.axhspan(kpi.old - kpi.spec.tolerance, kpi.old + kpi.spec.tolerance, color=_BAND, lw=0)
            axes.axhline(kpi.old, color=_OLD, lw=0.8)
        for limit in (kpi.spec.low, kpi.spec.high):
            if limit is not None and _near(limit, (*old, *new, *fresh), kpi.spec.tolerance):
                axes.axhline(limit, color=_INK, lw=0.8, ls="--")
        _strokes(axes, [(seed, seed, *pair) for seed, pair in enumerate(zip(old, new, strict=False))], _MUTED, 0.8)
        axes.plot(range(len(old)), old, "o", mfc="none", mec=_OLD, ms=5.0, mew=1.0)
        axes.plot(range(len(new)), new, "o", color=_NEW, ms=2.6)
        places = [len(new) + 1.0 + 8.0 * index / max(len(fresh), 1) for index in range(len(fresh))]
        # A round cap on a line of no length is a dot, at a tenth of a marker's bytes.
        _strokes(axes, [(x, x, y, y) for x, y in zip(places, fresh, strict=True)], _NEW, 2.0)
        ticks = [((len(new) - 1) / 2, f"{len(new)} paired seeds")]
        ticks += [(len(new) + 5.0, f"{len(fresh)} fresh seeds")] if fresh else []
        axes.set_xticks([place for place, _ in ticks], [text for _, text in ticks])
        axes.tick_params(axis="x", length=0)
        axes.set_xlim(-0.7, len(new) + (9.5 if fresh else -0.3))
        return self._svg(figure, f"{kpi.name}, value of each seed, golden and now")

    def distribution(self, kpi: KpiResult) -> str:
        """The cumulative distribution of a distance's feature, golden and now; empty if neither is known."""
        pairs = [("old", kpi.old_quantiles), ("new", kpi.new_quantiles)]
        known = [value for _, values in pairs for value in values]
        if not known or not all(map(math.isfinite, known)):
            return ""
        figure, axes = self._axes()
        for which, quantiles in pairs:
            levels = [(index + 0.5) / len(quantiles) for index in range(len(quantiles))]
            if which == "old":
                axes.plot(quantiles, levels, color=_OLD, lw=2.4)
            else:
                axes.plot(quantiles, levels, color=_NEW, lw=1.2, ls=(0, (4, 2)))
        if min(known) > 0.0 and max(known) > 3.0 * min(known):
            axes.set_xscale("log")
            _label_decades(axes, min(known), max(known))
        axes.set_yticks([0.0, 0.5, 1.0], ["0", "50 %", "100 %"])
        axes.set_ylim(-0.02, 1.02)
        return self._svg(figure, f"{kpi.name}, cumulative distribution, golden and now")

    def shift(self, kpi: KpiResult) -> str:
        """How far each quantile of a distance's feature has moved, now minus golden; empty if it is not known."""
        moved = [new - old for old, new in zip(kpi.old_quantiles, kpi.new_quantiles, strict=False)]
        if not moved or not all(map(math.isfinite, moved)):
            return ""
        figure, axes = self._axes()
        axes.axhline(0.0, color=_OLD, lw=0.8)
        axes.plot([(index + 0.5) / len(moved) for index in range(len(moved))], moved, color=_NEW, lw=1.2)
        axes.set_xticks([0.0, 0.5, 1.0], ["0", "50 %", "100 %"])
        axes.set_xlim(0.0, 1.0)
        return self._svg(figure, f"{kpi.name}, shift of each quantile, now minus golden")

    def _axes(self) -> tuple[Any, Axes]:
        from matplotlib.figure import Figure
        from matplotlib.ticker import FuncFormatter, MaxNLocator

        figure = Figure(figsize=(_WIDTH_IN, _HEIGHT_IN))
        figure.patch.set_visible(False)
        axes = figure.add_axes(_AXES)
        axes.patch.set_visible(False)
        axes.yaxis.set_major_locator(MaxNLocator(3))
        axes.xaxis.set_major_locator(MaxNLocator(4))
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(_plain))
        return figure, axes

    def _svg(self, figure: Any, label: str) -> str:
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
        text = stream.getvalue()
        self._plots += 1
        text = _NEEDLESS.sub("", text[text.index("<svg ") :])
        text = _EMPTY_GROUP.sub("", _EMPTY_GROUP.sub("", text))
        text = _LONG_NUMBER.sub(lambda match: f"{float(match.group()):.1f}", text)
        text = _ID.sub(rf"\g<1>p{self._plots}-", text)
        text = _FONT.sub("font-family: var(--font)", text)
        for colour, variable in _VARIABLES.items():
            text = text.replace(colour, f"var({variable})")
        size = f"0 0 {_WIDTH_IN * 72:g} {_HEIGHT_IN * 72:g}"
        opening = f'<svg class="plot" role="img" aria-label="{html.escape(printable(label))}" viewBox="{size}">'
        text = "".join(f"{line.strip()}\n" for line in text.splitlines() if line.strip())
        return _OPENING.sub(lambda _match: opening, text, count=1)  # a name may hold what a template reads


def _strokes(axes: Axes, ends: Sequence[tuple[float, float, float, float]], colour: str, width: float) -> None:
    """Separate lines (x0, x1, y0, y1) as one path."""
    x = [value for x0, x1, _, _ in ends for value in (x0, x1, math.nan)]
    y = [value for _, _, y0, y1 in ends for value in (y0, y1, math.nan)]
    axes.plot(x, y, color=colour, lw=width, solid_capstyle="round")


def _near(limit: float, values: Sequence[float], tolerance: float) -> bool:
    """Whether a limit lies where drawing it does not squeeze everything else."""
    finite = [value for value in values if math.isfinite(value)]
    room = 2.0 * (max(finite) - min(finite)) + 2.0 * tolerance
    return min(finite) - room <= limit <= max(finite) + room


def _label_decades(axes: Axes, low: float, high: float) -> None:
    """Ticks at 1, 2 and 5 in each decade, or at decades where there are many."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    wide = high > 300.0 * low
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(_plain))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _plain(value: float, _position: int | None) -> str:
    return f"{value:.6g}"
