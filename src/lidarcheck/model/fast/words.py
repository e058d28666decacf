"""A sample in eight bytes: what one pulse made of one beam.

Bits 0 to 3: `NONE`, no echo; `ONE`, an echo, in the bits above; `MANY`, the number of a row of a table of samples that
hold several echoes or a number that has no room here; `SPECIAL`, of a beam that has drawn, see `draw.py`. Of the one
echo: width in bins (8 bits), peak (12), area (16), and its centre as seen from the pulse's (24), in steps of 2^-14 bins
from -512 bins on.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck.model.exact.echoes import EchoArrays

__all__ = ["pack"]

NONE, ONE, SPECIAL, MANY, KIND = 0, 1, 14, 15, 15
WIDTH_AT, PEAK_AT, AREA_AT, CENTRE_AT = 4, 12, 24, 40
WIDTH_BITS, PEAK_BITS, AREA_BITS, CENTRE_BITS = 8, 12, 16, 24
ROW_AT = 4
CODE_AT, LIBRARY_AT, PLACE_AT = 4, 8, 16
CODE_BITS, LIBRARY_BITS = 4, 8
CENTRE_STEP = 2.0**-14
CENTRE_ZERO = 1 << (CENTRE_BITS - 1)


def pack(echoes: EchoArrays, pulse: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.uint64], npt.NDArray[np.int64]]:
    """Words of samples, shape (n,), and the samples that go into the table, in its order.

    `pulse` (n,): the pulse's centre [bins].
    """
    one = echoes.held == 1
    away = np.where(one, echoes.centre[:, 0], pulse) - pulse
    fields = (
        (np.where(one, echoes.width[:, 0], 0), WIDTH_AT, WIDTH_BITS),
        (np.where(one, echoes.peak[:, 0], 0), PEAK_AT, PEAK_BITS),
        (np.where(one, echoes.area[:, 0], 0), AREA_AT, AREA_BITS),
        (np.rint(away / CENTRE_STEP).astype(np.int64) + CENTRE_ZERO, CENTRE_AT, CENTRE_BITS),
    )
    words = np.full(len(pulse), ONE, dtype=np.uint64)
    fits = one.copy()
    for column, at, bits in fields:
        words |= column.astype(np.uint64) << np.uint64(at)
        fits &= (column >= 0) & (column < 1 << bits)
    many = np.flatnonzero((echoes.held > 0) & ~fits)
    words[many] = np.arange(len(many), dtype=np.uint64) << np.uint64(ROW_AT) | np.uint64(MANY)
    words[echoes.held == 0] = NONE
    return words, many
