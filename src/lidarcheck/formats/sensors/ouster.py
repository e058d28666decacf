"""Ouster's metadata JSON: nested, as firmware writes it since 2.1, and the flat form before.

Position of a return R in column c of w, with the SDK's `make_xyz_lut`: the encoder stands at -360 c/w deg in the lidar
frame, the beam at that minus its `beam_azimuth_angles`; its origin is `beam_to_lidar_transform`'s x along the encoder
and z up, and the reported range has the length of that origin in it; `lidar_to_sensor_transform` then turns by 180 deg
and lifts. Lengths are millimetres, angles degrees.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from lidarcheck.formats.sensors.imported import Given, Imported, Lacking, linear_lacks
from lidarcheck.formats.sensors.ouster_meta import Metadata
from lidarcheck.formats.sensors.values import Values

__all__ = ["import_ouster", "is_ouster"]

_REFLECTIVITY: dict[str, Any] = {"law": "calibrated_reflectivity", "bits": 8, "aliases": ["reflectivity"]}
_CALIBRATED_SINCE = (2, 1)
"""The firmware since which reflectivity is calibrated."""


def is_ouster(data: Any) -> bool:
    """Whether JSON has the keys of a sensor's metadata."""
    return isinstance(data, dict) and any(
        key in data for key in ("beam_intrinsics", "beam_altitude_angles", "lidar_data_format")
    )


def import_ouster(values: Values, _given: Given) -> Imported:
    """The sensor of a metadata file; `InputError` where its lists are incomplete, empty or of another length."""
    meta = Metadata(values)
    azimuths, altitudes = meta.angles("beam_azimuth_angles"), meta.angles("beam_altitude_angles")
    if altitudes and isinstance(altitudes[0], list):
        altitudes, azimuths = _flat(altitudes), _flat(azimuths)
    columns, rate_hz = meta.mode()
    channels = meta.channels(max(len(altitudes), len(azimuths)))
    if len(altitudes) > channels and len(altitudes) == channels * columns:
        return _solid_state(meta, azimuths, altitudes, channels, columns)
    return _spinning(meta, azimuths, altitudes, channels, (columns, rate_hz))


def _flat(rows: Sequence[Any]) -> list[Any]:
    return [angle for row in rows for angle in (row if isinstance(row, list) else [row])]


def _spinning(
    meta: Metadata, azimuths: list[Any], altitudes: list[Any], channels: int, mode: tuple[int, float]
) -> Imported:  # fmt: skip
    columns, rate_hz = mode
    elevation, azimuth, fired = meta.beams(azimuths, altitudes, channels)
    yaw_deg, lift_m = meta.frame()
    first, count = meta.window(columns)
    step = 360.0 / columns
    start = yaw_deg - first * step
    beams: dict[str, Any] = {
        "kind": "channels",
        "elevation_deg": elevation,
        "azimuth_offset_deg": [-angle + 0.0 for angle in azimuth],
    }
    lacking: list[Lacking] = []
    shifts = meta.shifts(len(altitudes))
    if shifts is None:
        look_up = "pixel_shift_by_row of the metadata that the sensor writes with newer firmware; without it images "
        lacking.append(Lacking("beams.column_shift", 0, look_up + "stay staggered"))
    else:
        beams["column_shift"] = [shifts[index] for index in fired]
    if len(fired) < len(altitudes):
        beams["ring"] = fired
    lacking += meta.origin(beams, lift_m)
    beams |= {"columns": count, "azimuth_deg": {"first": start + 0.0, "last": start - count * step}}
    document, more, remarks = _common(meta, rate_hz)
    document["sweep"] = {"direction": "right"}
    if count < columns:
        document["sweep"]["duration_s"] = count / columns / rate_hz
        remarks.append(f"Only columns {first} to {(first + count - 1) % columns} of {columns} are measured: Point 0 is "
                       f"column {first}.")  # fmt: skip
    document["beams"] = beams
    return Imported(document, (*lacking, *more), tuple(remarks))


def _solid_state(meta: Metadata, azimuths: list[Any], altitudes: list[Any], channels: int, columns: int) -> Imported:
    """A DF unit: each pixel has its own angles, positive to the left, and nothing turns."""
    elevation, azimuth = meta.finite("beam_altitude_angles", altitudes), meta.finite("beam_azimuth_angles", azimuths)
    yaw_deg, lift_m = meta.frame()
    pixels = range(channels * columns)
    beams: dict[str, Any] = {"kind": "table"}
    lacking = meta.origin(beams, lift_m)
    table: dict[str, Sequence[float]] = {
        "Layer": [pixel // columns for pixel in pixels],
        "Point": [pixel % columns for pixel in pixels],
        "elevation_deg": elevation,
        "azimuth_deg": [angle + yaw_deg for angle in azimuth],
    }
    x_m, z_m = beams.pop("origin_m", 0.0), beams.pop("height_m", 0.0)
    if beams.pop("range_offset_m", 0.0) or x_m:
        raise meta.values.fault((), "a solid-state unit with an origin away from its centre", "no key describes it")
    if z_m:
        table |= {f"origin_{axis}_m": [value] * len(pixels) for axis, value in (("x", 0.0), ("y", 0.0), ("z", z_m))}
    document, more, remarks = _common(meta, meta.mode()[1])
    document["sweep"] = {"order": "flash"}
    document["beams"] = beams
    remarks.append("A solid-state unit: all pixels are taken to measure at one instant.")
    lacking = [entry for entry in lacking if not entry.key.endswith("_m")]
    return Imported(document, (*lacking, *more), tuple(remarks), table)


def _common(meta: Metadata, rate_hz: float) -> tuple[dict[str, Any], list[Lacking], list[str]]:
    """Name, rate, returns, features, steps."""
    profile = meta.profile()
    document: dict[str, Any] = {
        "name": " ".join(word for word in (meta.text("prod_line"), meta.text("prod_sn")) if word) or "Ouster",
        "source": [
            f"{meta.values.lines.file.name}: Ouster metadata, firmware {meta.text('build_rev') or 'unknown'}, "
            f"profile {profile or 'unknown'}",
            "a counting detector as linear with excess 1: amplitude in photons",
        ],
        "detector": "linear",
        "frame_rate_hz": rate_hz,
    }
    if profile and "DUAL" in profile:
        document |= {"returns": 2, "keep": "strongest_second"}
    features, lacking = _features(profile, meta.version())
    if profile is None:
        lacking.append(Lacking("range.step_m", 0.001, "0.001 of 19- and 20-bit profiles, 0.008 of RNG15"))
    else:
        document["range"] = {"step_m": 0.008 if "RNG15" in profile else 0.001}
    document |= {"linear": {"excess": 1.0}, "features": features}
    lacking += linear_lacks()
    lacking += [
        Lacking("linear.noise", 4, "fitted from repeats, in photons"),
        Lacking("linear.threshold", 24, "fitted from repeats, in photons"),
    ]
    return document, lacking, []


def _features(profile: str | None, version: tuple[int, int] | None) -> tuple[dict[str, Any], list[Lacking]]:
    """What the profile's name says is reported: RFL8 reflectivity, SIG16 photons, NIR16 ambient light."""
    words = (profile or "").split("_")
    legacy = profile == "LEGACY"
    features: dict[str, Any] = {}
    lacking: list[Lacking] = []
    calibrated = version is not None and version >= _CALIBRATED_SINCE
    if "RFL8" in words or (legacy and calibrated):
        features["REFLECTIVITY"] = _REFLECTIVITY
    elif not calibrated:
        look_up = "calibrated since firmware 2.1; before, a signal times the square of the range, of unknown gain"
        lacking.append(Lacking("features.REFLECTIVITY", _REFLECTIVITY, look_up))
    if "SIG16" in words or legacy:
        features["SIGNAL"] = {"law": "affine", "unit": "photons", "bits": 16, "aliases": ["signal"]}
    bits = next((int(word[3:]) for word in words if re.fullmatch(r"NIR\d{1,2}", word)), 16 if legacy else 0)
    if bits:
        features["NEAR_IR"] = {"law": "background", "bits": bits, "aliases": ["near_ir", "ambient"]}
    if profile is None:
        look_up = "udp_profile_lidar of the sensor's configuration says which features it reports"
        lacking.append(Lacking("features.SIGNAL", {"law": "affine", "bits": 16, "aliases": ["signal"]}, look_up))
    return features, lacking
