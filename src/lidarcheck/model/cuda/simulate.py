"""The exact chain on an NVIDIA GPU: one beam a thread, by the same functions that the processor runs.

Streams depend on the beam and not on who draws from them, so that the draws are the same. What follows is the same sums
and products; a GPU's compiler may fuse a product with a sum, and its logarithms and exponentials differ from those of a
processor in the last digit, so that now and then a beam may end differently, and statistics do not.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses
from lidarcheck.model.exact.single import level_of, new_scratch
from lidarcheck.model.streams import Stream

__all__ = ["check_cuda", "simulate_on_cuda"]

_TOGETHER = 64
"""Threads that are started together."""
_MOST_THREADS = 1 << 17
_MOST_BYTES = 1 << 31
"""What the threads work in takes no more of the GPU's memory."""


def check_cuda() -> None:
    """`UsageError` where there is no GPU that can be used."""
    cuda = _cuda()
    reason = "its compiler (NVVM) is missing"
    try:
        if cuda.is_available():
            return
        cuda.current_context()
    except cuda.cudadrv.error.CudaSupportError as error:
        said = [line.strip(" .:") for line in str(error).splitlines() if not line.startswith("Error at")]
        reason = next((line for line in said if line), "its driver does not answer")
    fix = "leave out the device, or install NVIDIA's driver and `pip install 'lidarcheck[cuda]'`"
    raise UsageError(f"no GPU can be used: {reason}", fix=fix)


def simulate_on_cuda(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    order: IndexArray,
    echoes: EchoArrays,
) -> None:
    """What `kernel.simulate_beams` does, on the GPU; `order` has beams of one background together."""
    from lidarcheck.model.cuda.kernel import simulate_beams as run

    host = new_scratch(numbers)
    own = (host.counts, host.rates, host.draws, host.blocks.held, host.blocks.crowds, host.blocks.cells)
    threads = max(min(len(order), _MOST_THREADS, _MOST_BYTES // sum(part.nbytes for part in own)), 1)
    rows = [_rows(part, threads) for part in own]
    key, keys, light, inverse, group, there = _on_device((stream.key, beams, pulses, host.inverse, host.group, echoes))
    for some in _of_one_background(order, per_bin):
        level = level_of(numbers, host.blocks, pulses, float(per_bin[some[0]]))
        mine = min(threads, len(some))
        run[-(-mine // _TOGETHER), _TOGETHER](
            numbers, key, stream.counter[2], keys, level, light, _on_device(some), mine, *rows, inverse,
            _on_device(host.blocks), group, there,
        )  # fmt: skip
    columns: list[npt.NDArray[Any]] = list(echoes)
    for column, its in zip(columns, there, strict=True):
        column[...] = its.copy_to_host()


def _cuda() -> Any:
    from numba import cuda

    return cuda


def _of_one_background(order: IndexArray, per_bin: FloatArray) -> Iterator[IndexArray]:
    """The beams of each background, which share a table."""
    yield from np.split(order, np.flatnonzero(np.diff(per_bin[order])) + 1) if len(order) else ()


def _rows(part: npt.NDArray[Any], threads: int) -> Any:
    """Work space of all threads, zero; those that run together stand side by side, so that they are served at once."""
    return _cuda().to_device(np.zeros((len(part), threads), dtype=part.dtype))


def _on_device(thing: Any) -> Any:
    """Arrays copied to the GPU, in tuples of all kinds."""
    if isinstance(thing, np.ndarray):
        return _cuda().to_device(np.ascontiguousarray(thing))
    if isinstance(thing, tuple):
        parts = [_on_device(part) for part in thing]
        return type(thing)(*parts) if hasattr(thing, "_fields") else tuple(parts)
    return thing
