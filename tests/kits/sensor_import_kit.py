"""Calibration files of every vendor in small, written by hand, and where their sensors put an echo."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.formats.sensors import Given, Imported, document_text, import_sensor, sensor_of_import
from lidarcheck.sensor import Sensor

IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
ALTITUDES = [20.5, 15.25, 10.0, 5.5, 0.25, -5.0, -10.5, -16.0]
AZIMUTHS = [4.2, 1.4, -1.4, -4.2, 4.2, 1.4, -1.4, -4.2]


def ouster() -> dict[str, Any]:
    """Nested metadata of a sensor of 8 channels and 512 columns, its beams 15.8 mm ahead and 1.2 mm up."""
    shift = [9, 3, -3, -9, 9, 3, -3, -9]
    return {
        "beam_intrinsics": {
            "beam_altitude_angles": ALTITUDES,
            "beam_azimuth_angles": AZIMUTHS,
            "beam_to_lidar_transform": [1, 0, 0, 15.8, 0, 1, 0, 0, 0, 0, 1, 1.2, 0, 0, 0, 1],
            "lidar_origin_to_beam_origin_mm": 15.8,
        },
        "lidar_intrinsics": {"lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1]},
        "lidar_data_format": {
            "column_window": [0, 511],
            "columns_per_frame": 512,
            "pixel_shift_by_row": shift,
            "pixels_per_column": 8,
            "udp_profile_lidar": "RNG19_RFL8_SIG16_NIR16_DUAL",
        },
        "config_params": {"lidar_mode": "512x10", "azimuth_window": [0, 360000]},
        "sensor_info": {"prod_line": "OS-1-8", "prod_sn": "122", "build_rev": "v3.0.1"},
    }


def velodyne(lasers: int = 8, **more: Any) -> str:
    """A driver's YAML; `more` replaces values of all lasers."""
    rows = []
    for number in range(lasers):
        own = {
            "laser_id": number,
            "vert_correction": 0.05 * ((number * 5) % lasers) - 0.2,
            "rot_correction": 0.01 * (number % 4) - 0.015,
            "vert_offset_correction": 0.19 + 0.002 * number,
            "horiz_offset_correction": 0.026 * (-1) ** number,
            "dist_correction": 1.2 + 0.01 * number,
            "min_intensity": 5,
            "max_intensity": 250,
        } | more
        rows.append("- {" + ", ".join(f"{key}: {value}" for key, value in own.items()) + "}")
    return "lasers:\n" + "\n".join(rows) + f"\nnum_lasers: {lasers}\ndistance_resolution: 0.002\n"


def veloview(enabled: int = 8, rows: int = 10) -> str:
    """The same lasers as a db.xml in degrees and cm, and some that are not enabled."""
    items = []
    for number in range(rows):
        elevation = math.degrees(0.05 * ((number * 5) % 8) - 0.2) if number < enabled else 0.0
        items.append(
            f"<item><px><id_>{number}</id_>"
            f"<rotCorrection_>{math.degrees(0.01 * (number % 4) - 0.015)!r}</rotCorrection_>"
            f"<vertCorrection_>{elevation!r}</vertCorrection_><distCorrection_>120</distCorrection_>"
            f"<vertOffsetCorrection_>{19 + 0.2 * number}</vertOffsetCorrection_>"
            f"<horizOffsetCorrection_>{2.6 * (-1) ** number}</horizOffsetCorrection_></px></item>"
        )
    flags = "".join(f"<item>{int(number < enabled)}</item>" for number in range(rows))
    return (
        '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>\n<boost_serialization signature="x" version="5">\n'
        f"<DB><distLSB_>0.2</distLSB_><enabled_><count>{rows}</count>{flags}</enabled_>"
        f"<points_><count>{rows}</count>\n" + "\n".join(items) + "</points_></DB></boost_serialization>\n"
    )


def hesai(channels: int = 8) -> str:
    """An angle table."""
    rows = [f"{n},{15 - 4 * n + 0.25:.3f},{(-1) ** n * 1.042:.3f}" for n in range(1, channels + 1)]
    return "Channel,Elevation,Azimuth\n" + "\n".join(rows) + "\n"


def isaac(states: int = 1) -> dict[str, Any]:
    """A rotary lidar of 8 emitters and 720 firings a turn."""
    state = {
        "azimuthDeg": [0.0, 1.0, -1.0, 0.5] * 2,
        "elevationDeg": ALTITUDES,
        "fireTimeNs": [1512 * at for at in range(8)],
        "channelId": [8, 7, 6, 5, 4, 3, 2, 1],
        "vertOffsetM": [0.01] * 8,
        "horOffsetM": [0.02] * 8,
    }
    profile = {
        "scanType": "rotary", "rotationDirection": "CW", "nearRangeM": 0.3, "farRangeM": 120.0, "startAzimuthDeg": 0.0,
        "rangeResolutionM": 0.004, "rangeAccuracyM": 0.02, "minReflectance": 0.1, "minReflectanceRange": 80.0,
        "pulseTimeNs": 6, "maxReturns": 2, "scanRateBaseHz": 10.0, "reportRateBaseHz": 7200, "numberOfEmitters": 8,
        "azimuthErrorStd": 0.025, "minDistBetweenEchos": 0.4,
        "emitterStates": [state] * states,
    }  # fmt: skip
    return {"class": "sensor", "type": "lidar", "name": "Rotary", "profile": profile}


def usda() -> str:
    """The same as attributes of USD."""
    lines = []
    for key, value in isaac()["profile"].items():
        if key == "emitterStates":
            for name, cells in value[0].items():
                lines.append(f"float[] omni:sensor:Core:emitterState:s001:{name} = {json.dumps(cells)}")
        else:
            lines.append(f"uniform token omni:sensor:Core:{key} = {json.dumps(value)}")
    return '#usda 1.0\ndef OmniLidar "Rotary" (\n)\n{\n    ' + "\n    ".join(lines) + "\n}\n"


def helios(channels: int = 8) -> str:
    """A scanner of some channels and one without."""
    rows = "".join(
        f'<channel id="{at}"><beamOrigin x="0.01" y="0.02" z="0.03"><rot axis="x" angle_deg="{ALTITUDES[at]}" />'
        "</beamOrigin></channel>\n"
        for at in range(channels)
    )
    return (
        '<?xml version="1.0"?>\n<document>\n<scanner id="turning" accuracy_m="0.03" beamDivergence_rad="0.0007" '
        'name="Turning" optics="rotating" pulseFreqs_Hz="18000" pulseLength_ns="4" rangeMin_m="0.01" rangeMax_m="100" '
        f'maxNOR="2" headRotatePerSecMax_deg="7200">\n<channels>{rows}</channels></scanner>\n'
        '<scanner id="risley" name="Risley" optics="risley" pulseFreqs_Hz="100000" accuracy_m="0.02"></scanner>\n'
        "</document>\n"
    )


def sdf(vertical: str = "<samples>16</samples><resolution>1</resolution><min_angle>-0.26</min_angle>"
        "<max_angle>0.26</max_angle>") -> str:  # fmt: skip
    """A lidar of 640 x 16 rays."""
    return (
        '<?xml version="1.0"?>\n<sdf version="1.9"><model name="m"><link name="l">'
        '<sensor name="front" type="gpu_lidar">\n'
        "<update_rate>10</update_rate><lidar><scan><horizontal><samples>640</samples><resolution>1</resolution>"
        f"<min_angle>-1.2</min_angle><max_angle>1.2</max_angle></horizontal><vertical>{vertical}</vertical></scan>\n"
        "<range><min>0.08</min><max>30.0</max><resolution>0.01</resolution></range>"
        "<noise><type>gaussian</type><mean>0.01</mean><stddev>0.02</stddev></noise></lidar></sensor>"
        "</link></model></sdf>\n"
    )


def carla() -> dict[str, Any]:
    """The blueprint at its defaults; values are text, as the client hands them out."""
    return {
        "id": "sensor.lidar.ray_cast",
        "attributes": {
            "channels": "32", "range": "10.0", "points_per_second": "56000", "rotation_frequency": "10.0",
            "upper_fov": "10.0", "lower_fov": "-30.0", "horizontal_fov": "360.0", "noise_stddev": "0.02",
            "atmosphere_attenuation_rate": "0.004", "dropoff_general_rate": "0.45", "dropoff_intensity_limit": "0.8",
            "dropoff_zero_intensity": "0.4",
        },
    }  # fmt: skip


def osi() -> dict[str, Any]:
    """A configuration of 12 directions with times."""
    angles = [(math.radians(e), math.radians(a)) for e in (-5, 0, 5) for a in (10, 5, 0, -5)]
    vectors = [{"x": math.cos(e) * math.cos(a), "y": math.cos(e) * math.sin(a), "z": math.sin(e)} for e, a in angles]
    for vector in vectors:  # as protobuf writes JSON
        for axis in [axis for axis, value in vector.items() if value == 0.0]:
            del vector[axis]
    return {
        "sensorId": {"value": "1"}, "fieldOfViewHorizontal": 0.35, "fieldOfViewVertical": 0.2,
        "updateCycleTime": {"seconds": "0", "nanos": 50000000}, "maxNumberOfInteractions": 2, "numOfPixels": 12,
        "directions": vectors, "timings": [100 * at for at in range(12)],
    }  # fmt: skip


def written(directory: Path, name: str, content: Any) -> Path:
    """The file, of text or of JSON."""
    path = directory / name
    path.write_text(content if isinstance(content, str) else json.dumps(content, indent=1), encoding="utf-8")
    return path


def imported(path: Path, **given: Any) -> Imported:
    return import_sensor(path, Given(**given))


def sensor(found: Imported) -> Sensor:
    """The sensor that the written file describes: through its text, and with examples of what it lacks."""
    import tomllib

    text = tomllib.loads(document_text(found, table_file="beams.csv"))
    assert {key: text[key] for key in found.document if key != "beams"} == {
        key: value for key, value in found.document.items() if key != "beams"
    }
    sensor_of_import(found, Path("f"), all_keys=True)
    return sensor_of_import(found, Path("f"))


def positions(of: Sensor, layer: Any, point: Any, range_m: Any) -> np.ndarray:
    """Where echoes of these ranges lie."""
    return of.beams.positions_m(np.asarray(layer), np.asarray(point), np.asarray(range_m, np.float64))


def ouster_xyz(meta: dict[str, Any], row: int, column: int, range_m: float) -> np.ndarray:
    """The SDK's lookup table, for one pixel: directions and offsets, then the transform into the sensor's frame."""
    intrinsics = meta.get("beam_intrinsics", meta)
    form = meta.get("lidar_data_format") or meta.get("data_format")
    width = form["columns_per_frame"]
    to_lidar = np.array(intrinsics["beam_to_lidar_transform"], float).reshape(4, 4)
    to_sensor = np.array(meta.get("lidar_intrinsics", meta)["lidar_to_sensor_transform"], float).reshape(4, 4)
    length = to_lidar[0, 3] if to_lidar[2, 3] == 0 else math.hypot(to_lidar[0, 3], to_lidar[2, 3])
    encoder = 2 * math.pi * (1 - column / width)
    azimuth = -math.radians(intrinsics["beam_azimuth_angles"][row])
    altitude = math.radians(intrinsics["beam_altitude_angles"][row])
    direction = np.array([
        math.cos(encoder + azimuth) * math.cos(altitude),
        math.sin(encoder + azimuth) * math.cos(altitude),
        math.sin(altitude),
    ])  # fmt: skip
    offset = np.array([math.cos(encoder) * to_lidar[0, 3], math.sin(encoder) * to_lidar[0, 3], to_lidar[2, 3]])
    in_lidar = direction * (1000 * range_m - length) + offset
    return (to_sensor[:3, :3] @ in_lidar + to_sensor[:3, 3]) / 1000
