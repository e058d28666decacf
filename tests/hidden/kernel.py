"""Every detector of every beam, followed on its own from avalanche to avalanche (numba).

The waiting time to the next avalanche is drawn by inverting the summed rate: the first bin k from where the detector
is armed with sum(rate) > E, E exponential, has exactly the chance 1 - exp(-rate) per bin. No mean-field shortcut.
"""

# Compiled functions take their types from the call.
# mypy: allow-untyped-defs, allow-untyped-calls

import math

import numba as nb
import numpy as np

BINS = 2002  # of 1 ns: 0 ... 300 m
LEAD_BINS = 256  # run-in, so that detectors enter the trace as the background leaves them
DEAD_FIXED, DEAD_UNIFORM, DEAD_EXPONENTIAL = 0, 1, 2
AFTER_NONE, AFTER_EXPONENTIAL, AFTER_LOG_UNIFORM = 0, 1, 2
CROSS_NONE, CROSS_NEIGHBOURS, CROSS_ANYWHERE = 0, 1, 2
MOST_RUNS = 256


@nb.njit(cache=True)
def _uniform(stream):
    """A uniform number in (0, 1]: SplitMix64 (Steele, Lea and Flood, OOPSLA 2014); `stream` (1,) is its state."""
    stream[0] += np.uint64(0x9E3779B97F4A7C15)
    z = stream[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return (float(z >> np.uint64(11)) + 1.0) * 1.1102230246251565e-16


@nb.njit(cache=True)
def _next(summed, quiet, start, end, uniform):
    """First bin from `start` on whose summed rate passes a wait drawn by a uniform number; `end` for none.

    `quiet` is the background's rate and the bins between which there is more than it: outside them the bin follows
    without a search.
    """
    wait = -math.log(uniform)
    target = summed[start] + wait
    if summed[end] <= target:
        return end
    background, first_lit, last_lit = quiet
    if background > 0.0:
        k = start + int(wait / background)
        if k < first_lit or start >= last_lit:
            return min(k, end - 1)
    low, high = start, end
    while low < high:
        middle = (low + high) // 2
        if summed[middle + 1] > target:
            high = middle
        else:
            low = middle + 1
    return low


@nb.njit(cache=True)
def _dead_bins(mode, on, dead, spread, stream):
    if mode == DEAD_UNIFORM:
        return max(on, math.floor(dead + spread * (2.0 * _uniform(stream) - 1.0) + 0.5))
    if mode == DEAD_EXPONENTIAL:
        return on + math.floor(0.5 - spread * math.log(_uniform(stream)))
    return dead


@nb.njit(cache=True)
def _afterpulse(bin_k, armed, end, mode, share, short, long, stream):
    """Bin of the afterpulse of an avalanche in `bin_k`; `end` for none or one that falls into the dead time."""
    if mode == AFTER_NONE or _uniform(stream) >= share:
        return end
    if mode == AFTER_EXPONENTIAL:
        at = armed + math.floor(-short * math.log(_uniform(stream)))
    else:
        at = bin_k + int(short * math.exp(_uniform(stream) * math.log(long / short)))
    return at if armed <= at < end else end


@nb.njit(cache=True)
def _light_up(trace, bin_k, on):
    """One detector more from a bin on, and one less when its time ON is over: `trace` holds the changes."""
    begin = bin_k - LEAD_BINS
    trace[min(max(begin, 0), BINS)] += 1
    trace[min(max(begin + on, 0), BINS)] -= 1


@nb.njit(cache=True)
def _shot_alone(trace, summed, quiet, end, detectors, on, dead, after, stream):
    """Detectors that know nothing of each other."""
    nothing = math.exp(-summed[end])  # the chance of no avalanche at all
    dead_bins, dead_mode, dead_spread = dead
    after_mode, share, short, long = after
    for _ in range(detectors):
        first = _uniform(stream)
        if first <= nothing:
            continue
        natural = _next(summed, quiet, 0, end, first)
        pending = end
        while True:
            k = min(natural, pending)
            if k >= end:
                break
            _light_up(trace, k, on)
            armed = k + _dead_bins(dead_mode, on, dead_bins, dead_spread, stream)
            if pending < armed:
                pending = end
            pending = min(pending, _afterpulse(k, armed, end, after_mode, share, short, long, stream))
            natural = end if armed >= end else _next(summed, quiet, armed, end, _uniform(stream))


@nb.njit(cache=True)
def _shot_coupled(trace, summed, quiet, end, spads, on, dead, after, cross, first, neighbour, chance, scratch, stream):
    """Detectors that set each other off within a bin, followed in the order of time."""
    dead_bins, dead_mode, dead_spread = dead
    after_mode, share, short, long = after
    cross_mode, anywhere, cascade = cross
    natural, pending, armed, stack = scratch[0], scratch[1], scratch[2], scratch[3]
    for i in range(spads):
        armed[i] = 0
        pending[i] = end
        natural[i] = _next(summed, quiet, 0, end, _uniform(stream))
    while True:
        k = end
        for i in range(spads):
            k = min(k, natural[i], pending[i])
        if k >= end:
            break
        fired = 0
        for i in range(spads):
            if natural[i] == k or pending[i] == k:
                stack[fired] = i
                fired += 1
                armed[i] = end + 1  # at most once a bin
        primary = fired
        at = 0
        while at < fired:
            i = stack[at]
            if cascade or at < primary:
                if cross_mode == CROSS_NEIGHBOURS:
                    for j in range(first[i], first[i + 1]):
                        m = neighbour[j]
                        if _uniform(stream) < chance[j] and armed[m] <= k:
                            stack[fired] = m
                            fired += 1
                            armed[m] = end + 1
                elif _uniform(stream) < anywhere:
                    m = min(int(_uniform(stream) * spads), spads - 1)
                    if armed[m] <= k:
                        stack[fired] = m
                        fired += 1
                        armed[m] = end + 1
            at += 1
        for at in range(fired):
            i = stack[at]
            _light_up(trace, k, on)
            armed[i] = k + _dead_bins(dead_mode, on, dead_bins, dead_spread, stream)
            if pending[i] < armed[i]:
                pending[i] = end
            pending[i] = min(pending[i], _afterpulse(k, armed[i], end, after_mode, share, short, long, stream))
            late = armed[i] >= end
            natural[i] = end if late else _next(summed, quiet, armed[i], end, _uniform(stream))


@nb.njit(cache=True)
def _rates(summed, background, arrival, signal, shape, mask, shot, rows, table, table_start, table_step):
    """Rate of each bin, from background and the pulses of one beam and shot; the bins between which pulses lie."""
    first_lit, last_lit = LEAD_BINS + BINS, 0
    summed[:] = background
    last = table.shape[1] - 1
    for j in range(rows[0], rows[1]):
        if not (mask[j] >> shot) & 1:
            continue
        begin = arrival[j] + table_start
        before = 0.0
        from_bin = max(math.floor(begin), 0)
        first_lit = min(first_lit, LEAD_BINS + from_bin)
        for k in range(from_bin, BINS):
            x = (k + 1 - begin) / table_step
            i = int(x)
            now = 1.0
            if x < 0.0:
                now = 0.0
            elif i < last:
                now = table[shape[j], i] + (x - i) * (table[shape[j], i + 1] - table[shape[j], i])
            summed[LEAD_BINS + k] += signal[j] * (now - before)
            before = now
            last_lit = max(last_lit, LEAD_BINS + k + 1)
            if now > 1.0 - 1e-9:
                break
    return first_lit, last_lit


@nb.njit(cache=True)
def _add_haze(summed, profile, gain, cut_bin, pulse_bins):
    """Backscatter of the air up to the surface, whose edge is as soft as the pulse."""
    for k in range(min(BINS, int(cut_bin + 4 * pulse_bins) + 1)):
        left = 0.5 * math.erfc((k + 0.5 - cut_bin) / (pulse_bins * 1.4142135623730951))
        summed[LEAD_BINS + k] += gain * profile[k] * left


@nb.njit(cache=True)
def _accumulate(summed, end):
    total = 0.0
    for k in range(end + 1):
        rate = summed[k] if k < end else 0.0
        summed[k] = total
        total += rate


@nb.njit(cache=True)
def _echoes(trace, threshold, peak_saturation, delay_ns, runs):
    """Runs above the threshold, as time, PEAK, AREA and WIDTH; their number."""
    found = 0
    k = 0
    while k < BINS:
        if trace[k] <= threshold:
            k += 1
            continue
        area, moment, peak, width = 0.0, 0.0, 0.0, 0
        while k < BINS and trace[k] > threshold:
            area += trace[k]
            moment += trace[k] * (k + 0.5)
            peak = max(peak, float(trace[k]))
            width += 1
            k += 1
        if found < MOST_RUNS:
            runs[found, 0] = moment / area - delay_ns
            runs[found, 1] = min(peak, peak_saturation)
            runs[found, 2] = area
            runs[found, 3] = width
            found += 1
    return found


@nb.njit(cache=True, nogil=True)
def follow(
    seed, first_row, arrival, signal, shape, mask, table, table_start, table_step, background, threshold,
    profiles, profile_of, haze_gain, cut_bin, pulse_bins, spads, shots, on, dead, after, cross,
    first, neighbour, chance, peak_saturation, delay_ns,
):  # fmt: skip
    """Echoes of all beams, (m, 5): beam, time [ns], PEAK, AREA, WIDTH; by beam, then by time."""
    stream = np.full(1, seed, np.uint64)
    beams = len(background)
    out = np.empty((3 * beams, 5))
    written = 0
    end = LEAD_BINS + BINS
    summed = np.zeros(end + 1)
    trace = np.zeros(BINS + 1, np.int64)
    runs = np.zeros((MOST_RUNS, 4))
    scratch = np.zeros((4, spads), np.int64)
    for b in range(beams):
        trace[:] = 0
        rows = (first_row[b], first_row[b + 1])
        alike = True
        quiet = (background[b], 0, end)
        for j in range(rows[0], rows[1]):
            alike = alike and mask[j] == (1 << shots) - 1
        for shot in range(shots):
            if shot == 0 or not alike:
                first_lit, last_lit = _rates(
                    summed, background[b], arrival, signal, shape, mask, shot, rows, table, table_start, table_step
                )
                quiet = (background[b], first_lit, last_lit)
                if profile_of[b] >= 0:
                    quiet = (background[b], 0, end)
                    _add_haze(summed, profiles[profile_of[b]], haze_gain[b], cut_bin[b], pulse_bins)
                _accumulate(summed, end)
            if cross[0] == CROSS_NONE:
                _shot_alone(trace, summed, quiet, end, spads, on, dead, after, stream)
            else:
                _shot_coupled(
                    trace, summed, quiet, end, spads, on, dead, after, cross, first, neighbour, chance, scratch, stream
                )  # fmt: skip
        for k in range(1, BINS):
            trace[k] += trace[k - 1]
        found = _echoes(trace, threshold[b], peak_saturation, delay_ns, runs)
        kept = np.sort(np.argsort(-runs[:found, 2])[:3])
        for q in kept:
            out[written, 0] = b
            out[written, 1:] = runs[q]
            written += 1
    return out[:written]
