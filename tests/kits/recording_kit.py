"""Recordings of a small turning sensor in a room, by numpy alone: what a user has who has no model of anything."""

from __future__ import annotations

import numpy as np

RINGS, COLUMNS = 16, 180
ELEVATION = np.deg2rad(np.linspace(-15.0, 15.0, RINGS))
WALLS = np.array([9.0, 7.0, 3.0])
"""Half of the room's length, width and height [m]."""


def frame(seed, *, place_m=(0.0, 0.0, 0.0), noise_m=0.01, lost=0.0, columns=COLUMNS):
    """Layer, point, x, y, z and intensity of a frame: each wall has a reflectance of its own, echoes scatter."""
    draw = np.random.default_rng(seed)
    layer = np.tile(np.arange(RINGS), columns)
    point = np.repeat(np.arange(columns), RINGS)
    azimuth = np.deg2rad(180.0 - point * 360.0 / columns)
    level = np.cos(ELEVATION[layer])
    u = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(ELEVATION[layer])], axis=1)
    with np.errstate(divide="ignore"):
        ways = (np.sign(u) * WALLS - np.array(place_m)) / np.where(u == 0.0, np.nan, u)
    wall = np.nanargmin(ways, axis=1)
    rows = np.arange(len(u))
    reflectance = np.array([[0.3, 0.5, 0.15], [0.8, 0.6, 0.2]])[(u[rows, wall] > 0.0).astype(int), wall]
    value = np.clip(np.round(100.0 * reflectance * np.abs(u[rows, wall]) + 2.5 * draw.standard_normal(len(u))), 1, 255)
    range_m = np.round((ways[rows, wall] + noise_m * draw.standard_normal(len(u))) / 0.002) * 0.002
    kept = draw.random(len(u)) >= lost
    return layer[kept], point[kept], (u * range_m[:, None])[kept], value[kept].astype(int)


def write_frame(file, seed, **how):
    """A frame as CSV, as drivers write it: x, y, z, intensity, ring; and Layer, Point, EchoNumber."""
    layer, point, xyz, value = frame(seed, **how)
    with file.open("w", encoding="utf-8") as stream:
        stream.write("X,Y,Z,Layer,Point,EchoNumber,INTENSITY\n")
        for (x, y, z), a, b, v in zip(xyz.tolist(), layer.tolist(), point.tolist(), value.tolist(), strict=True):
            stream.write(f"{x:.5f},{y:.5f},{z:.5f},{a},{b},1,{v}\n")


def write_recording(folder, frames=6, **how):
    """A folder of frames of a sensor at rest."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(frames):
        write_frame(folder / f"frame_{number:03d}.csv", 100 + number, **how)
    return folder
