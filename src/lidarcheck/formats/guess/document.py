"""A guess as the document of a sensor file: what the scans show, and what they do not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.formats.guess.guess import Guess
from lidarcheck.formats.sensors.imported import Imported, Lacking, linear_lacks, rate_lacks, step_lacks
from lidarcheck.formats.table import counted

__all__ = ["HEAD", "document_of"]

HEAD = (
    "Written by `lidarcheck sensor guess`. A key behind a hash is not in the scans: look it up, write its value and "
    "take the hash away."
)
_DECIMALS = {"deg": 5, "m": 4, "us": 3}
_LEAST_US = 0.01


def document_of(
    guess: Guess,
    name: str,
    rate_hz: float | None = None,
    features: Mapping[str, Mapping[str, Any]] | None = None,
    supposed: Sequence[str] = (),
    returns: int = 1,
) -> Imported:
    """The sensor file of a guess. `rate_hz`: frames a second, where the scans have no times; `features`: what their
    columns are supposed to report, None where nobody supposes it; `supposed`: why, as further sources; `returns`: how
    many echoes a beam has at most."""
    known_hz = rate_hz if rate_hz is not None else None if guess.turning is None else guess.turning.rate_hz
    document: dict[str, Any] = {
        "name": f"guess of {name}",
        "source": [f"guessed from {guess.rows} rows of {counted(guess.frames, 'frame')} of {name}", *supposed],
        "detector": "linear",
    }
    lacking: list[Lacking] = []
    if known_hz is None:
        lacking.append(rate_lacks("the data sheet, or the time between frames"))
    else:
        document["frame_rate_hz"] = known_hz
    if returns > 1:
        document["returns"] = returns
    if guess.turning is not None:
        document |= {"time_unit": guess.turning.unit, "time_zero": guess.turning.zero}
    # What the head turns until a channel fires is in its azimuth as it was seen.
    document["sweep"] = {"direction": "left" if guess.sense > 0 else "right", "fire_time_in_azimuth": False}
    if guess.range_step_m is not None:
        document["range"] = {"step_m": guess.range_step_m}
    document["beams"] = _beams(guess, lacking)
    lacking += linear_lacks()
    if features:
        # What the noise of a dark beam is, and with it how often there is an echo of nothing, no values tell.
        document["linear"] = {"false_rate_hz": 0}
        document["features"] = {key: dict(value) for key, value in features.items()}
    else:
        lacking.append(Lacking("features.INTENSITY", {"law": "calibrated_reflectivity", "bits": 8}, _FEATURE))
    return Imported(document, tuple(lacking), (*_remarks(guess), *guess.notes))


_FEATURE = "what the sensor reports of an echo besides its range, by the name of the file's column or with `aliases`"


def _beams(guess: Guess, lacking: list[Lacking]) -> dict[str, Any]:
    first = float(np.round(guess.beside.first_deg, _DECIMALS["deg"])) + 0.0
    beams: dict[str, Any] = {"kind": "channels"}
    beams["elevation_deg"] = _listed(_of_all_layers(guess, guess.rings.elevation_deg), "deg")
    if guess.columns is None:
        lacking.append(step_lacks(0.2, "the data sheet"))
    else:
        beams["azimuth_offset_deg"] = _listed(_of_all_layers(guess, guess.beside.offset_deg), "deg")
    for key, value in (
        ("origin_m", guess.forward_m),
        ("height_m", guess.up_m),
        ("range_offset_m", guess.range_offset_m),
    ):
        if value:
            beams[key] = round(value, _DECIMALS["m"])
    if guess.beside.fire_us is not None and float(np.ptp(guess.beside.fire_us)) > _LEAST_US:
        beams["fire_time_us"] = _listed(_of_all_layers(guess, guess.beside.fire_us), "us")
    ring = [int(number) for number in guess.rings.number]
    if guess.told == "ring" and ring != list(range(len(ring))):
        beams["ring"] = ring
    turn = -360.0 if guess.sense <= 0 else 360.0
    beams["azimuth_deg"] = {"first": first, "last": round(first + turn, _DECIMALS["deg"])}
    if guess.columns is not None:
        if guess.repeats:
            beams["columns"] = round(guess.columns.columns)
        else:
            beams |= {"azimuth_step_deg": float(f"{guess.columns.step_deg:.7g}"), "columns_repeat": False}
    return beams


def _of_all_layers(guess: Guess, values: FloatArray) -> FloatArray:
    """A value for each layer, where the scans number them: a layer without rows lies where its neighbours let it."""
    if guess.told != "Layer" or len(guess.rings.number) < 2:
        return values
    number, every = guess.rings.number, np.arange(int(guess.rings.number[-1]) + 1)
    step = (values[-1] - values[0]) / (number[-1] - number[0])
    found = np.interp(every, number, values)
    return np.asarray(np.where(every < number[0], values[0] + step * (every - number[0]), found))


def _listed(values: FloatArray, unit: str) -> list[float]:
    return [float(value) + 0.0 for value in np.round(values, _DECIMALS[unit])]


def _remarks(guess: Guess) -> list[str]:
    remarks = []
    if guess.told == "elevations":
        remarks.append("no column tells the rings: channels are numbered by ascending elevation")
    if guess.columns is not None and guess.repeats and guess.frames == 1:
        remarks.append("one frame does not show whether its columns are those of the next: a turn has a whole number")
    if not guess.sense:
        remarks.append("direction is supposed: right")
    return remarks
