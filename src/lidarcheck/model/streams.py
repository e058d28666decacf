"""Random numbers that depend on what they are for, and on nothing else.

Philox4x64-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC11), the generator behind
`numpy.random.Philox`, written out here so that kernels can run it. The key is (seed, purpose), the counter (draw, beam,
frame, 0): threads, chunks, the order of beams and other effects cannot change a draw.

A draw is a uniform number in [0, 1), the upper 53 bits of a word times 2^-53, as numpy makes it from the same words.
"""

from __future__ import annotations

import hashlib
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from lidarcheck.jit import inlined, kernel
from lidarcheck.model.lane_math import LANES
from lidarcheck.model.sharing import Share, serially

__all__ = [
    "Stream",
    "beam_keys",
    "fill",
    "fill_abreast",
    "fill_four",
    "fill_twice",
    "fill_twice_abreast",
    "new_stream",
    "philox",
    "philox_round",
    "purpose_key",
    "rewind",
    "skip",
    "uniforms",
    "unit",
]

_M0, _M1 = np.uint64(0xD2E7470EE14C6C93), np.uint64(0xCA5A826395121157)
_W0, _W1 = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBB67AE8584CAA73B)
_ROUNDS = 10
_ONE, _ELEVEN = np.uint64(1), np.uint64(11)
_CHUNK = 32768
"""Beams that draw at a time: few enough to share the work evenly."""
_UNIT = 1.0 / 9007199254740992.0
_LOW_HALF, _HALF = np.uint64(0xFFFFFFFF), np.uint64(32)
_LANES: Any = np.uint64(LANES)
_X0, _X1, _X2, _X3 = (np.uint64(word * LANES) for word in range(4))


class Stream(NamedTuple):
    """Where a stream stands; kernels count it up in place, so each thread has its own.

    `counter`: block, beam, frame, 0. `key`: seed, purpose. Both `uint64`.
    """

    counter: npt.NDArray[np.uint64]
    key: npt.NDArray[np.uint64]


def _high_word_of(typing_context: Any, a: Any, b: Any) -> Any:
    """Upper 64 bits of the 128-bit product of two `uint64`."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        wide = ir.IntType(128)
        product = builder.mul(builder.zext(args[0], wide), builder.zext(args[1], wide))
        return builder.trunc(builder.lshr(product, ir.Constant(wide, 64)), ir.IntType(64))

    return types.uint64(types.uint64, types.uint64), codegen


_high_word: Any = intrinsic(_high_word_of)


@inlined
def philox(key0: Any, key1: Any, block: Any, beam: Any, frame: Any, branch: Any) -> Any:
    """Four words: a block of a beam's draws. `branch`: the counter's last word, 0 but for what avalanches set off."""
    x0, x1, x2, x3 = np.uint64(block), beam, frame, np.uint64(branch)
    k0, k1 = key0, key1
    for _ in range(_ROUNDS):
        high0, low0 = _high_word(_M0, x0), _M0 * x0
        high1, low1 = _high_word(_M1, x2), _M1 * x2
        x0, x1, x2, x3 = high1 ^ x1 ^ k0, low1, high0 ^ x3 ^ k1, low0
        k0 += _W0
        k1 += _W1
    return x0, x1, x2, x3


@inlined
def unit(word: Any) -> Any:
    """The uniform number in [0, 1) that a word makes."""
    # A shifted word fits a signed integer, which converts to floating point faster than an unsigned one.
    return np.float64(np.int64(word >> _ELEVEN)) * _UNIT


@kernel
def fill(stream: Stream, draws: npt.NDArray[np.float64], count: int) -> None:
    """Write the next `count` draws, rounded up to whole blocks of four, to the front of `draws`.

    One call for many draws: between kernels, numba counts references to the arrays it passes, which costs more than
    the draws themselves.
    """
    key0, key1 = stream.key[0], stream.key[1]
    block, beam, frame, branch = stream.counter[0], stream.counter[1], stream.counter[2], stream.counter[3]
    for at in range(0, count, 4):
        first, second, third, fourth = philox(key0, key1, block, beam, frame, branch)
        draws[at], draws[at + 1], draws[at + 2], draws[at + 3] = unit(first), unit(second), unit(third), unit(fourth)
        block += _ONE
    stream.counter[0] = block


@inlined
def _turned(word: Any) -> Any:
    """A word with its halves exchanged."""
    return (word << _HALF) | (word >> _HALF)


@kernel
def fill_twice(stream: Stream, draws: npt.NDArray[np.float64], count: int) -> None:
    """`fill` with two draws of each word, eight of a block: of the word, and of the word with its halves exchanged.

    Each draw is a uniform number as fine as any; the two of a word are independent to 32 bits: whoever asks whether
    they lie above some limits sees a dependence with a chance of 2^-32 for each limit.
    """
    key0, key1 = stream.key[0], stream.key[1]
    block, beam, frame, branch = stream.counter[0], stream.counter[1], stream.counter[2], stream.counter[3]
    for at in range(0, count, 8):
        first, second, third, fourth = philox(key0, key1, block, beam, frame, branch)
        draws[at], draws[at + 1] = unit(first), unit(_turned(first))
        draws[at + 2], draws[at + 3] = unit(second), unit(_turned(second))
        draws[at + 4], draws[at + 5] = unit(third), unit(_turned(third))
        draws[at + 6], draws[at + 7] = unit(fourth), unit(_turned(fourth))
        block += _ONE
    stream.counter[0] = block


@inlined
def fill_four(stream: Stream, draws: npt.NDArray[np.float64]) -> None:
    """`fill` with a count of one to four, for where few draws decide whether there are more."""
    key, counter = stream.key, stream.counter
    first, second, third, fourth = philox(key[0], key[1], counter[0], counter[1], counter[2], counter[3])
    draws[0], draws[1], draws[2], draws[3] = unit(first), unit(second), unit(third), unit(fourth)
    counter[0] += _ONE


@inlined
def _wide_product(factor: Any, x: Any) -> Any:
    """Upper and lower 64 bits of a product, from products of halves, which vectors of numbers can form."""
    low, high = factor & _LOW_HALF, factor >> _HALF
    x_low, x_high = x & _LOW_HALF, x >> _HALF
    first = low * x_low
    second = high * x_low + (first >> _HALF)
    third = low * x_high + (second & _LOW_HALF)
    return high * x_high + (second >> _HALF) + (third >> _HALF), (third << _HALF) | (first & _LOW_HALF)


@inlined
def philox_round(x0: Any, x1: Any, x2: Any, x3: Any, k0: Any, k1: Any) -> Any:
    """One of the rounds of a block, for many beams at a time."""
    high0, low0 = _wide_product(_M0, x0)
    high1, low1 = _wide_product(_M1, x2)
    return high1 ^ x1 ^ k0, low1, high0 ^ x3 ^ k1, low0


@inlined
def _words_abreast(stream: Stream, beams: npt.NDArray[np.uint64], block: Any, words: npt.NDArray[np.uint64]) -> None:
    """A block of four words of each of `LANES` beams: word k of beam i stands at k * LANES + i."""
    frame = stream.counter[2]
    for lane in range(_LANES):
        words[_X0 + lane], words[_X1 + lane] = block, beams[lane]
        words[_X2 + lane], words[_X3 + lane] = frame, np.uint64(0)
    k0, k1 = stream.key[0], stream.key[1]
    for _ in range(_ROUNDS // 2):
        for lane in range(_LANES):
            x = words[_X0 + lane], words[_X1 + lane], words[_X2 + lane], words[_X3 + lane]
            x = philox_round(x[0], x[1], x[2], x[3], k0, k1)
            x = philox_round(x[0], x[1], x[2], x[3], k0 + _W0, k1 + _W1)
            words[_X0 + lane], words[_X1 + lane], words[_X2 + lane], words[_X3 + lane] = x
        k0 += _W0 + _W0
        k1 += _W1 + _W1


@kernel
def fill_abreast(
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    blocks: int,
    words: npt.NDArray[np.uint64],
    draws: npt.NDArray[np.float64],
) -> None:
    """The first 4 `blocks` draws of each of `LANES` beams: what `fill` writes for one beam after `rewind`.

    `draws`, flat: draw k of beam i stands at k * LANES + i. `words` (4 LANES,) is work space. `stream` stays as it is.
    """
    for block in range(np.uint64(blocks)):
        _words_abreast(stream, beams, block, words)
        first = block * (_X3 + _LANES)
        for k in range(_X3 + _LANES):
            draws[first + k] = np.float64(words[k] >> _ELEVEN) * _UNIT


@inlined
def fill_twice_abreast(
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    blocks: int,
    words: npt.NDArray[np.uint64],
    draws: npt.NDArray[np.float64],
) -> None:
    """The first 8 `blocks` draws of each of `LANES` beams: what `fill_twice` writes for one; see `fill_abreast`."""
    for block in range(np.uint64(blocks)):
        _words_abreast(stream, beams, block, words)
        for word in range(np.uint64(4)):
            row, first = word * _LANES, (np.uint64(8) * block + np.uint64(2) * word) * _LANES
            for lane in range(_LANES):
                draws[first + lane] = np.float64(words[row + lane] >> _ELEVEN) * _UNIT
                draws[first + _LANES + lane] = np.float64(_turned(words[row + lane]) >> _ELEVEN) * _UNIT


@kernel
def skip(stream: Stream, count: int) -> None:
    """Leave out what `fill` would write."""
    stream.counter[0] += np.uint64((count + 3) // 4)


@kernel
def rewind(stream: Stream, beam: Any) -> None:
    """Go to the first draw of a beam."""
    stream.counter[0] = np.uint64(0)
    stream.counter[1] = beam


def purpose_key(purpose: str) -> int:
    """The 64-bit key of a purpose: an effect's name, or a step of the model. It never changes."""
    return int.from_bytes(hashlib.blake2b(purpose.encode(), digest_size=8).digest(), "little")


def new_stream(seed: int, purpose: str, frame: int = 0) -> Stream:
    """A stream of a seed, a purpose and a frame, standing before the first draw of beam 0."""
    return Stream(
        counter=np.array([0, 0, frame, 0], dtype=np.uint64),
        key=np.array([seed, purpose_key(purpose)], dtype=np.uint64),
    )


def beam_keys(layer: npt.ArrayLike, point: npt.ArrayLike) -> npt.NDArray[np.uint64]:
    """The number by which streams know a beam: 2^32 layer + point, shape (n,)."""
    return np.asarray(layer, dtype=np.uint64) << np.uint64(32) | np.asarray(point, dtype=np.uint64)


@kernel
def _uniforms(
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    held: npt.NDArray[np.uint64],
    words: npt.NDArray[np.uint64],
    draws: npt.NDArray[np.float64],
    out: npt.NDArray[np.float64],
) -> None:
    """The first draws of each beam into its row of `out`, `LANES` beams at a time; the others are work space."""
    n, count = out.shape
    for start in range(0, n, LANES):
        for lane in range(LANES):
            held[lane] = beams[min(start + lane, n - 1)]
        fill_abreast(stream, held, (count + 3) // 4, words, draws)
        for lane in range(min(LANES, n - start)):
            for k in range(count):
                out[start + lane, k] = draws[k * LANES + lane]


def uniforms(
    seed: int,
    purpose: str,
    frame: int,
    layer: npt.ArrayLike,
    point: npt.ArrayLike,
    draws: int = 1,
    among: Share = serially,
) -> npt.NDArray[np.float64]:
    """Uniform numbers in [0, 1), shape (n_beams, draws): the first draws of each beam for that purpose."""
    stream, beams = new_stream(seed, purpose, frame), beam_keys(layer, point)
    out = np.empty((len(beams), draws))

    def fill_rows(start: int) -> None:
        rows = slice(start, start + _CHUNK)
        held, words = np.empty(LANES, dtype=np.uint64), np.empty(4 * LANES, dtype=np.uint64)
        _uniforms(stream, beams[rows], held, words, np.empty((draws + 3) // 4 * 4 * LANES), out[rows])

    among(fill_rows, range(0, len(beams), _CHUNK))
    return out
