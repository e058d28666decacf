"""Whether the terminal shows no more than ASCII."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["is_seven_bit"]


def is_seven_bit(environ: Mapping[str, str]) -> bool:
    """Whether the locale says that the terminal shows no UTF-8.

    Python itself sets LC_CTYPE to C.UTF-8 where the locale is C (PEP 538), so that alone says nothing.
    """
    said = environ.get("LC_ALL") or ""
    if not said:
        own = environ.get("LC_CTYPE", "")
        said = own if own and own != "C.UTF-8" else environ.get("LANG", "")
    return "utf" not in said.lower()
