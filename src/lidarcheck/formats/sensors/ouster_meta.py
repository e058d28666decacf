"""What Ouster's metadata says, whichever of its two forms it has, and what is wrong with it."""

from __future__ import annotations

import math
import re
from typing import Any

from lidarcheck.errors import InputError
from lidarcheck.formats.sensors.imported import Lacking, rounded
from lidarcheck.formats.sensors.values import MOST_CHANNELS, Values, check_degrees

__all__ = ["Metadata"]

_MODE = re.compile(r"(\d{1,5})x(\d{1,3})")
_LINE = re.compile(r"-(16|32|64|128)\b")
_VERSION = re.compile(r"v?(\d{1,3})\.(\d{1,3})")
_MOST_COLUMNS = 8192


class Metadata:
    """The metadata, whichever of the two forms it has."""

    def __init__(self, values: Values) -> None:
        self.values = values
        self.nested = isinstance(values.find("beam_intrinsics"), dict)

    def at(self, group: str, key: str) -> tuple[str | int, ...]:
        """Where a key of a group stands."""
        return (group, key) if self.nested else (key,)

    def text(self, key: str) -> str | None:
        """What the sensor says of itself."""
        return self.values.text(*self.at("sensor_info", key))

    def version(self) -> tuple[int, int] | None:
        """Of the firmware, major and minor."""
        found = _VERSION.search(self.text("build_rev") or self.text("image_rev") or "")
        return None if found is None else (int(found[1]), int(found[2]))

    def profile(self) -> str | None:
        """None only of firmware before 2, which has no data format; the first that has none to choose is LEGACY."""
        if not self.has_form():
            return "LEGACY" if self.is_before_2() else None
        return self.values.text(self.form(), "udp_profile_lidar") or "LEGACY"

    def is_before_2(self) -> bool:
        """Whether the firmware is known to be older than 2.0, which has no data format."""
        version = self.version()
        return version is not None and version < (2, 0)

    def has_form(self) -> bool:
        """Whether there is a data format; old firmware answers "error: Command not recognized." in its place."""
        return isinstance(self.values.find(self.form()), dict)

    def form(self) -> str:
        """The group of the data format."""
        return "lidar_data_format" if self.nested else "data_format"

    def angles(self, key: str) -> list[Any]:
        """A list of the beams, whatever is in it."""
        return self.values.entries(*self.at("beam_intrinsics", key))

    def mode(self) -> tuple[int, float]:
        """Columns a turn and turns a second."""
        path = self.values.first(("config_params", "lidar_mode"), ("lidar_mode",))
        text = self.values.text(*path)
        found = _MODE.fullmatch(text or "")
        if text and not found:
            raise self.values.fault(path, f"lidar_mode {text[:40]!r} is no mode such as 1024x10")
        per_frame = self.values.maybe(self.form(), "columns_per_frame", low=1, high=_MOST_COLUMNS)
        rate = self.values.maybe(self.form(), "fps", low=1, high=1000)
        columns = int(per_frame) if per_frame else int(found[1]) if found else 0
        hz = float(found[2]) if found else rate or 0.0
        if not 0 < columns <= _MOST_COLUMNS or not hz:
            raise self.values.fault(path, "lidar_mode is missing: columns a turn and turns a second are not known")
        if found and int(found[1]) != columns:
            what = f"lidar_mode says {found[1]} columns, columns_per_frame {columns}"
            raise self.values.fault((self.form(), "columns_per_frame"), what)
        return columns, hz

    def channels(self, listed: int) -> int:
        """How many channels there are, by the data format; without one, by the longer list or the product's name."""
        form = self.form()
        if self.has_form() or (self.nested and not self.is_before_2()):
            return self.values.whole(form, "pixels_per_column", low=1, high=MOST_CHANNELS)
        named = _LINE.search(self.text("prod_line") or "")
        return max(listed, int(named[1])) if named else listed

    def beams(
        self, azimuths: list[Any], altitudes: list[Any], channels: int
    ) -> tuple[list[float], list[float], list[int]]:
        """Elevations, azimuths, and the rows that fire; a unit of 16 or 32 in a body of 64 has zeros between."""
        for key, found in (("beam_altitude_angles", altitudes), ("beam_azimuth_angles", azimuths)):
            if len(found) != channels:
                what = f"{key} has {len(found)} numbers for {channels} channels"
                raise self.values.fault(self.at("beam_intrinsics", key), what)
        elevation = self.finite("beam_altitude_angles", altitudes)
        azimuth = self.finite("beam_azimuth_angles", azimuths)
        if not any(elevation):
            what = "beam_altitude_angles are all 0: the sensor had not read its calibration"
            raise self.values.fault(self.at("beam_intrinsics", "beam_altitude_angles"), what)
        fired = [row for row in range(channels) if elevation[row] or azimuth[row]]
        named = _LINE.search(self.text("prod_line") or "")
        if len(fired) not in (channels, int(named[1]) if named else channels) and channels - len(fired) > 1:
            product = self.text("prod_line") or "unknown"
            what = f"{channels - len(fired)} of {channels} channels have no angles, the product is {product}"
            raise self.values.fault(self.at("beam_intrinsics", "beam_altitude_angles"), what)
        if channels - len(fired) <= 1:
            fired = list(range(channels))  # one channel may look straight ahead
        return [elevation[row] for row in fired], [azimuth[row] for row in fired], fired

    def finite(self, key: str, numbers: list[Any]) -> list[float]:
        """The same as numbers; refused where one is none, or in another unit."""
        path = self.at("beam_intrinsics", key)
        found = Values({key: numbers}, self.values.lines).numbers(key)

        def fault(what: str, fix: str) -> InputError:
            return self.values.fault(path, what, fix)

        if key == "beam_altitude_angles":
            check_degrees(found, key, fault)
        elif max(map(abs, found), default=0.0) > 360.0:
            raise fault(f"{key} of {max(map(abs, found)):g} deg is beyond 360", "export the file from the sensor again")
        return found

    def shifts(self, channels: int) -> list[int] | None:
        """From firing to image columns, a channel; None where the file has none."""
        if self.values.find(self.form(), "pixel_shift_by_row") is None:
            return None
        found = self.values.numbers(self.form(), "pixel_shift_by_row", count=channels)
        if any(shift != int(shift) or abs(shift) > _MOST_COLUMNS for shift in found):
            raise self.values.fault(
                (self.form(), "pixel_shift_by_row"), "pixel_shift_by_row are whole numbers of columns"
            )
        return [int(shift) for shift in found]

    def origin(self, beams: dict[str, Any], lift_m: float) -> list[Lacking]:
        """Put the beams' origin into the table; what the file lacks of it."""
        transform = self.transform(self.at("beam_intrinsics", "beam_to_lidar_transform"))
        path = self.at("beam_intrinsics", "lidar_origin_to_beam_origin_mm")
        x_mm, z_mm = self.values.maybe(*path, low=-1000, high=1000), 0.0
        if transform is not None:
            x_mm, z_mm = transform[3], transform[11]
            if transform[7]:
                raise self.values.fault(path, "beam_to_lidar_transform moves the beams sideways", "no SDK reads that")
        if x_mm is not None:
            self.check_length(path, x_mm)
            beams |= {"origin_m": rounded(x_mm / 1000.0, "m"), "height_m": rounded((z_mm / 1000.0) + lift_m, "m")}
            beams["range_offset_m"] = rounded(math.hypot(x_mm, z_mm) / 1000.0 if z_mm else x_mm / 1000.0, "m")
            return []
        beams["height_m"] = rounded(lift_m, "m")
        look_up = (
            "lidar_origin_to_beam_origin_mm of the sensor: 12.163 mm of a first OS1, 15.806 of an OS1, 27.67 of an OS0"
        )
        return [Lacking("beams.origin_m", 0.012163, look_up), Lacking("beams.range_offset_m", 0.012163, "as origin_m")]

    def check_length(self, path: tuple[str | int, ...], x_mm: float) -> None:
        """The same length may stand in metres where somebody made the file: 0.0277 for 27.7."""
        other = self.values.maybe(*self.at("beam_intrinsics", "lidar_origin_to_beam_origin_mm"))
        if (0.0 < abs(x_mm) < 0.5) or (other is not None and abs(other - x_mm) > 0.5):
            what = f"the beams' origin is {x_mm:g} mm" + (
                "" if other is None else f", and {other:g} mm by the other key"
            )
            raise self.values.fault(path, what, "use millimetres in both")

    def frame(self) -> tuple[float, float]:
        """The turn [deg] and the lift [m] of lidar_to_sensor_transform; 180 deg and 0 where a file has none."""
        path = self.at("lidar_intrinsics", "lidar_to_sensor_transform")
        found = self.transform(path)
        if found is None:
            raise self.values.fault(path, "lidar_to_sensor_transform is missing")
        level = all(abs(found[at] - one) < 1e-9 for at, one in ((2, 0), (6, 0), (8, 0), (9, 0), (10, 1)))
        cos, sin = found[0], found[4]
        turned = abs(cos - found[5]) < 1e-9 and abs(sin + found[1]) < 1e-9 and abs(math.hypot(cos, sin) - 1) < 1e-6
        if not level or not turned or found[3] or found[7]:
            what = "lidar_to_sensor_transform is more than a turn about Z and a lift"
            raise self.values.fault(path, what, "describe the rest as a pose of the scans (--pose)")
        return rounded(math.degrees(math.atan2(sin, cos)), "deg"), found[11] / 1000.0

    def transform(self, path: tuple[str | int, ...]) -> list[float] | None:
        """The 16 numbers of a transform, row by row, mm; None where there is none."""
        if self.values.find(*path) is None:
            return None
        found = self.values.numbers(*path, count=16)
        if found[12:] != [0, 0, 0, 1] or max(map(abs, found)) > 10_000:
            raise self.values.fault(path, f"{path[-1]} is no transform in millimetres, row by row")
        return found

    def window(self, columns: int) -> tuple[int, int]:
        """The first column that is measured, and how many are."""
        path: tuple[str | int, ...] = (self.form(), "column_window")
        if self.values.find(*path) is not None:
            first, last = self.values.numbers(*path, count=2)
            if not all(0 <= column < columns and column == int(column) for column in (first, last)):
                raise self.values.fault(path, f"column_window {first:g} to {last:g} is no part of 0 to {columns - 1}")
            return int(first), int((last - first) % columns) + 1
        path = self.values.first(("config_params", "azimuth_window"), ("azimuth_window",))
        if self.values.find(*path) is None:
            return 0, columns
        low, high = self.values.numbers(*path, count=2)
        turn = 36_000 if self.is_before_2() else 360_000  # hundredths of a degree, then thousandths
        if not (0 <= low <= turn and 0 <= high <= turn):
            raise self.values.fault(path, f"azimuth_window {low:g} to {high:g} is no part of 0 to {turn}, a turn")
        if (high - low) % turn == 0:
            return 0, columns
        first = math.ceil((turn - high) * columns / turn)
        last = math.floor((turn - low) * columns / turn)
        return first % columns, (last - first) % columns + 1
