"""The per-detector path: every SPAD of a beam followed on its own, for sensors whose SPADs disturb each other.

Crosstalk and afterpulsing tie an avalanche to the one that set it off, and a dead time that varies needs a memory of
its own, so the counts of the exact chain no longer tell what comes next. What is random stays as exact as there:

- Primary avalanches. Every (bin, detector) cell is a candidate with probability 1 - exp(-rate), independently, and
  counts if the detector is armed. An exponential number is spent on the cells' rates one after the other; where it runs
  out stands the next candidate. Quiet bins are passed by one division, bright ones look at armed detectors only.
- Crosstalk. An avalanche sets off each armed neighbour of its shot's array in the same bin, and so do those that it set
  off. Which of the neighbours it tries does not depend on the order in which avalanches of a bin are looked at.
- Afterpulses wait in a heap, ordered by the bin in which they are due; one whose detector is dead by then is lost.

Entry: a warm-up before bin 0, at whose start detectors are dead as background alone leaves them, in the steady state of
a fixed dead time. It lasts four of the longest dead times and five of the longest mean delay of afterpulses, over 1 -
the probability of an afterpulse, beyond which chains of them are forgotten to 1 % or less; 1000 ns at most for that.

Primary avalanches and what they set off draw from two streams: taking crosstalk out leaves the primaries' draws.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.jit import inlined, kernel
from lidarcheck.model.detectors.array import Detectors
from lidarcheck.model.detectors.heap import due_bin, pop, push
from lidarcheck.model.detectors.scratch import (
    DetectorScratch,
    add_fired,
    primary,
    rewind_both,
    secondary,
    set_all,
    waiting,
)
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses, add_rates, window
from lidarcheck.model.lane_math import fired, log, log1p
from lidarcheck.model.streams import Stream

__all__ = ["follow"]

_FEW = 8.0
"""Candidates a bin up to which it pays to thin them rather than to look for the detectors that are armed."""


@inlined
def _dead_bins(detectors: Detectors, draw: float) -> int:
    """A dead time from a uniform number: the smallest whose distribution function is above it."""
    at = detectors.dead_guide[int(draw * len(detectors.dead_guide))]
    while detectors.dead_up_to[at] <= draw:
        at += 1
    return detectors.dead_least + int(at)


@inlined
def _delay_bins(stream: Stream, scratch: DetectorScratch, detectors: Detectors) -> float:
    """An afterpulse's delay behind the end of the dead time."""
    mean = detectors.delay
    if detectors.slow_share > 0.0 and secondary(stream, scratch) < detectors.slow_share:
        mean = detectors.slow_delay
    return -log(1.0 - secondary(stream, scratch)) * mean


@kernel
def _set_off(
    numbers: Numbers,
    detectors: Detectors,
    stream: Stream,
    scratch: DetectorScratch,
    bin_: int,
    detector: int,
    draw: float,
    fired: int,
) -> int:
    """What an avalanche sets off that is known to set off something; returns how many have fired in this bin.

    `draw`, uniform and at least `quiet[0]`, leads to the first of the nine things that can happen, further draws from
    there to the next one.
    """
    first = 0
    while first < 9 and draw >= detectors.quiet[first]:
        survival = 1.0
        event = first
        while event < 8:
            survival *= 1.0 - detectors.chance[event]
            if survival <= draw:
                break
            event += 1
        if event < 8:
            other = detectors.neighbour[detector, event]
            if other >= 0 and scratch.armed_from[other] <= bin_:
                scratch.armed_from[other] = bin_ + 1
                scratch.fired[fired] = other
                fired += 1
        else:
            delay = _delay_bins(stream, scratch, detectors)
            if delay < numbers.bins - scratch.armed_from[detector]:
                push(scratch.heap, scratch.size, scratch.armed_from[detector] + int(delay), detector)
        first = event + 1
        draw = secondary(stream, scratch)
    return fired


@inlined
def _settle(
    numbers: Numbers, detectors: Detectors, stream: Stream, scratch: DetectorScratch, bin_: int, fired: int
) -> None:
    """Finish a bin in which the first `fired` of `scratch.fired` avalanche: dead times, and what they set off."""
    varies = len(detectors.dead_up_to) > 1
    quiet = detectors.quiet[0]
    done = 0
    while done < fired:
        detector = scratch.fired[done]
        done += 1
        dead = numbers.dead
        if varies:
            dead = _dead_bins(detectors, secondary(stream, scratch))
        scratch.armed_from[detector] = bin_ + dead
        if quiet < 1.0:
            draw = secondary(stream, scratch)
            if draw >= quiet:
                fired = _set_off(numbers, detectors, stream, scratch, bin_, detector, draw, fired)
    add_fired(numbers, scratch, bin_, fired)


@inlined
def _afterpulses(scratch: DetectorScratch, bin_: int) -> int:
    """Fire the detectors whose afterpulses are due in this bin, unless they are dead; returns how many fire."""
    fired = 0
    while scratch.size[0] > 0 and due_bin(scratch.heap) <= bin_:
        detector = pop(scratch.heap, scratch.size)
        if scratch.armed_from[detector] <= bin_:
            scratch.armed_from[detector] = bin_ + 1
            scratch.fired[fired] = detector
            fired += 1
    return fired


@kernel
def _through_quiet(
    numbers: Numbers, detectors: Detectors, stream: Stream, scratch: DetectorScratch, begin: int, end: int, rate: float
) -> None:
    """Run the bins `begin` ... `end - 1`, all of that rate, from one candidate or afterpulse to the next."""
    number = numbers.detectors
    cells = (end - begin) * number
    per_rate = 1.0 / rate
    clock, cell = scratch.clock[0], 0
    while True:
        left = rate * (cells - cell)
        candidate = end
        if clock < left:
            cell = min(cell + int(clock * per_rate), cells - 1)
            candidate = begin + cell // number
        while scratch.size[0] > 0 and due_bin(scratch.heap) < min(candidate, end):
            bin_ = due_bin(scratch.heap)
            fired = _afterpulses(scratch, bin_)
            if fired > 0:
                _settle(numbers, detectors, stream, scratch, bin_, fired)
        if candidate >= end:
            break
        fired = _afterpulses(scratch, candidate)
        detector = cell - (candidate - begin) * number
        if scratch.armed_from[detector] <= candidate:
            scratch.armed_from[detector] = candidate + 1
            scratch.fired[fired] = detector
            fired += 1
        cell += 1
        clock = waiting(stream, scratch)
        if fired > 0:
            _settle(numbers, detectors, stream, scratch, candidate, fired)
    scratch.clock[0] = clock - left


@kernel
def _bin_by_bin(
    numbers: Numbers, detectors: Detectors, stream: Stream, scratch: DetectorScratch, begin: int, end: int
) -> None:
    """Run the bins `begin` ... `end - 1`, whose rates stand at the front of `scratch.rates`."""
    armed = scratch.armed
    clock = scratch.clock[0]
    for bin_ in range(begin, end):
        rate = scratch.rates[bin_ - begin]
        fired = _afterpulses(scratch, bin_)
        cell, cells = 0, numbers.detectors
        looked_up = rate * cells > _FEW
        if looked_up:
            cells = 0
            for detector in range(numbers.detectors):
                armed[cells] = detector
                cells += 1 if scratch.armed_from[detector] <= bin_ else 0
        while clock < rate * (cells - cell):
            cell = min(cell + int(clock / rate), cells - 1)
            detector = armed[cell] if looked_up else cell
            if scratch.armed_from[detector] <= bin_:
                scratch.armed_from[detector] = bin_ + 1
                scratch.fired[fired] = detector
                fired += 1
            cell += 1
            clock = waiting(stream, scratch)
        clock -= rate * (cells - cell)
        if fired > 0:
            _settle(numbers, detectors, stream, scratch, bin_, fired)
    scratch.clock[0] = clock


@inlined
def _enter(numbers: Numbers, detectors: Detectors, stream: Stream, scratch: DetectorScratch, dead_rate: float) -> None:
    """All detectors at the start of the warm-up, dead with probability 1 - exp(-dead_rate) each, at any age."""
    begin = -detectors.warm_up
    set_all(scratch.armed_from, numbers.detectors, np.int32(begin))
    scratch.size[0] = 0
    cell = 0
    clock = waiting(stream, scratch)
    while clock < dead_rate * (numbers.detectors - cell):
        cell = min(cell + int(clock / dead_rate), numbers.detectors - 1)
        scratch.armed_from[cell] = begin + 1 + int(primary(stream, scratch) * (numbers.dead - 1))
        cell += 1
        clock = waiting(stream, scratch)
    scratch.clock[0] = clock - dead_rate * (numbers.detectors - cell)


@kernel
def follow(
    numbers: Numbers,
    detectors: Detectors,
    stream: Stream,
    scratch: DetectorScratch,
    beam: Any,
    per_bin: float,
    pulses: Pulses,
    i: int,
) -> None:
    """All avalanches of beam number `i`, into `scratch.counts`."""
    rewind_both(stream, scratch, beam)
    begin, end = window(numbers, pulses, i)
    bright = per_bin * numbers.detectors > _FEW
    if bright:
        begin, end = 0, numbers.bins
    _enter(numbers, detectors, stream, scratch, log1p((numbers.dead - 1) * fired(per_bin)))
    if bright:
        set_all(scratch.rates, detectors.warm_up, per_bin)
        _bin_by_bin(numbers, detectors, stream, scratch, -detectors.warm_up, 0)
    else:
        _through_quiet(numbers, detectors, stream, scratch, -detectors.warm_up, begin, per_bin)
    rates = scratch.rates
    set_all(rates, end - begin, per_bin)
    add_rates(pulses, i, begin, end, rates)
    _bin_by_bin(numbers, detectors, stream, scratch, begin, end)
    _through_quiet(numbers, detectors, stream, scratch, end, numbers.bins, per_bin)
