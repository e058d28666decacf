"""`lidarcheck sensor check`: how well a scan fits the beams of a sensor file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, JsonFlag, Quiet
from lidarcheck.cli.core.outputs import json_text
from lidarcheck.cli.core.terminal import Column, emit, hush, stage, table
from lidarcheck.errors import InputError, UsageError

if TYPE_CHECKING:
    from lidarcheck.formats.guess import ScanCheck

__all__ = ["check"]

_WORST = 8
"""Layers that are shown, the worst first, unless all are asked for."""
_COLUMNS = ("layer", "elevation deg", "rows", "azimuth off deg", "elevation off deg", "outside %")


def check(
    scan: Annotated[Path, Parameter(help="A scan with X, Y, Z.")],
    /,
    *,
    sensor: Annotated[str, Parameter(help="The sensor file, or the name of a built-in sensor.")],
    ring: Annotated[
        str | None, Parameter(help="The column of the rings, where it is not named ring, channel, line.")
    ] = None,
    all_layers: Annotated[bool, Flag, Parameter(name="--all", help="Show every layer, not only the worst.")] = False,
    json: JsonFlag = False,
    quiet: Quiet = False,
) -> int:
    """Say how well a scan fits the beams of a sensor file."""
    hush(quiet)
    from lidarcheck.formats.guess import check_scan, clouds_of
    from lidarcheck.formats.recognise import read_table
    from lidarcheck.model.files.sensor_file import load_sensor

    known = load_sensor(sensor)
    with stage(f"reading {scan.name}"):
        clouds = clouds_of(read_table(scan), ring=ring)
    try:
        checks = [check_scan(cloud, known) for cloud in clouds]
    except UsageError as error:
        raise InputError(error.what, file=scan, fix=error.fix) from None
    if json:
        emit(json_text({"file": str(scan), "sensor": known.name, "frames": [_document(one) for one in checks]}))
    else:
        for number, one in enumerate(checks):
            emit(_text(one, f"frame {number}: " if len(checks) > 1 else "", all_layers))
    return 0 if all(one.fits for one in checks) else 1


def _text(found: ScanCheck, frame: str, all_layers: bool) -> str:
    lines = [f"{frame}{found.verdict}: {found.said}{f'; {found.fix}' if found.fix else ''}"]
    lines.append(
        f"beams by {found.by}; {found.rows} rows, {found.judged} judged, {100.0 * found.share:.1f} % on their beams"
    )
    if found.layers:
        lines.append(f"off their beams: median {found.median_deg:.3g} deg, 99 % {found.most_deg:.3g} deg")
    lines += [f"note: {note}" for note in found.notes]
    worst = sorted(found.layers, key=lambda fit: -max(fit.outside, 1e-9) * 1e6 - _size(fit))
    shown = found.layers if all_layers or len(worst) <= _WORST else worst[:_WORST]
    rows = [
        [
            str(fit.layer), f"{fit.elevation_deg:.3f}", str(fit.rows), f"{fit.azimuth_off_deg:+.4f}",
            f"{fit.elevation_off_deg:+.4f}", f"{100.0 * fit.outside:.1f}",
        ]
        for fit in shown
    ]  # fmt: skip
    if rows:
        lines += ["", table([Column(name, right=True) for name in _COLUMNS], rows).rstrip("\n")]
    if len(shown) < len(found.layers):
        lines.append(f"the worst {len(shown)} of {len(found.layers)} layers; --all shows all")
    return "\n".join(lines)


def _size(fit: Any) -> float:
    return float(abs(fit.azimuth_off_deg) + abs(fit.elevation_off_deg))


def _document(found: ScanCheck) -> dict[str, Any]:
    names = ("verdict", "said", "fix", "by", "rows", "judged", "share", "median_deg", "most_deg")
    layers = [dict(vars(fit)) for fit in found.layers]
    # Without a row on a beam there is no median.
    values = {name: None if (value := getattr(found, name)) != value else value for name in names}
    return {**values, "notes": list(found.notes), "layers": layers}
