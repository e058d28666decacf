"""How numbers and names are written in figures and on pages."""

from __future__ import annotations

import math

__all__ = ["amount", "number", "short", "squeezed"]


def amount(value: float, digits: int = 3) -> str:
    """A number as a person reads it, with a true minus; a dash for none."""
    if not math.isfinite(value):
        return "–"
    written = f"{value:.{digits}g}"
    if "e" in written and 1e-4 <= abs(value) < 1e7:
        written = f"{value:.0f}"
    return written.replace("-0", "0").replace("-", "−") if float(written) == 0.0 else written.replace("-", "−")


def number(value: float, form: str = ".4g") -> str:
    """A number in a cell of a table, by its format; `-` for NaN."""
    return "-" if math.isnan(value) else format(value, form)


def short(words: str, letters: int) -> str:
    """The words, cut where they are longer than so many letters."""
    return words if len(words) <= letters else f"{words[: letters - 1].rstrip()}…"


def squeezed(words: str, letters: int, dots: str = "…") -> str:
    """The words, cut in the middle where they are longer: groups' names often differ at their ends."""
    if len(words) <= letters:
        return words
    end = (letters - len(dots)) // 2
    return f"{words[: letters - len(dots) - end]}{dots}{words[len(words) - end :]}"
