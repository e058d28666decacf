"""From echoes to what a sensor reports: the gate, the choice among echoes, features, and the rows of a file."""

import numpy as np
from numpy.typing import NDArray

from .detectors import Echoes
from .device import Beams, Device

F = NDArray[np.float64]


def reported(echoes: Echoes, beams: Beams, device: Device) -> Echoes:
    """Ranges rounded, what lies outside of the gate left out, the sensor's choice of each beam; by beam and range."""
    offset = device.range_offset_m(beams)[echoes.beam]
    reported_m = echoes.path_m + offset + float(device.document["range"].get("offset_m", 0.0))
    step = device.step_m
    reported_m = np.round(reported_m / step) * step if step else reported_m
    echoes.path_m = reported_m - offset
    low, high = device.gate_m
    echoes = echoes.kept((reported_m >= low - 1e-9) & (reported_m <= high + 1e-9) & (reported_m > 0))
    rows: list[int] = []
    order = np.lexsort((echoes.path_m, echoes.beam))
    for group in np.split(order, np.flatnonzero(np.diff(echoes.beam[order])) + 1):
        rows += _chosen(group, echoes, device)
    rows = sorted(rows, key=lambda r: (echoes.beam[r], echoes.path_m[r]))
    return echoes.kept(np.array(rows, np.int64))


def _chosen(group: NDArray[np.int64], echoes: Echoes, device: Device) -> list[int]:
    """What a beam keeps of its echoes, which come by range."""
    most = int(device.document.get("returns", 1))
    ranked = [int(r) for r in group[np.argsort(-echoes.amplitude[group], kind="stable")]]
    keep = str(device.document.get("keep", "strongest"))
    if keep == "strongest_last" and most > 1 and len(ranked) > 1:
        last = int(group[-1])
        return [ranked[0], last if last != ranked[0] else ranked[1]]
    if keep not in ("strongest", "strongest_last", "strongest_second"):
        raise ValueError(f"no rule {keep}")
    return ranked[:most]


def features(echoes: Echoes, beams: Beams, device: Device) -> dict[str, F]:
    """The file's columns of each echo, by the shortest of each feature's names."""
    columns: dict[str, F] = {}
    for name, law in device.document["features"].items():
        heading = (law.get("aliases") or [name])[0]
        if law["law"] == "histogram":
            counts = echoes.of_beams["counts"]
            columns |= {f"h{k}": counts[echoes.beam, k] for k in range(counts.shape[1])}
        else:
            columns[heading] = _value(law, echoes, device)
    return columns


def _value(law: dict[str, object], echoes: Echoes, device: Device) -> F:
    kind, own = law["law"], device.numbers
    top = 2.0 ** int(str(law["bits"])) - 1.0 if "bits" in law else np.inf
    if kind == "calibrated_reflectivity":
        knee, most, full = (float(str(law.get(k, d))) for k, d in (("knee", 100), ("max", 255), ("top_percent", 1e4)))
        percent = 100.0 * echoes.amplitude * (echoes.path_m**2 + float(own.get("near_m", 0.0)) ** 2)
        percent = np.maximum(percent / float(own["signal_at_1m"]), 0.0)
        above = knee + (most - knee) * np.log(np.maximum(percent, 100.0) / 100.0) / np.log(full / 100.0)
        curved = law.get("above", "log") == "log"
        value = np.where(percent <= 100.0, percent * knee / 100.0, above if curved else percent * knee / 100.0)
        return np.clip(np.round(value), 0.0, min(most, top))
    if kind == "background":
        return np.clip(np.round(echoes.of_beams["ambient"][echoes.beam]), 0.0, top)
    if kind == "confidence":
        return np.round(top * np.minimum(1.0, echoes.more["snr"] / float(str(law.get("snr_full", 20.0)))))
    if kind == "area_counts":
        return echoes.amplitude
    return echoes.more[{"peak_counts": "peak", "width_bins": "width_ns"}[str(kind)]]


def scan_text(echoes: Echoes, beams: Beams, device: Device, headings: F) -> str:
    """The measured file: echoes at their beams' nominal directions, as the sensor's own files have them."""
    offset = device.range_offset_m(beams)
    start = np.concatenate([[True], np.diff(echoes.beam) != 0])[: len(echoes.beam)]
    row = np.arange(len(echoes.beam))
    number = row - np.maximum.accumulate(np.where(start, row, 0)) + 1 if len(row) else row
    at = device.origins_m(beams)[echoes.beam] + echoes.path_m[:, None] * headings[echoes.beam]
    columns: dict[str, F] = {"X": at[:, 0], "Y": at[:, 1], "Z": at[:, 2]}
    if offset.any() or device.detector == "photon_histogram":
        columns["RANGE"] = echoes.path_m + offset[echoes.beam]
    columns |= {"Layer": beams.layer[echoes.beam], "Point": beams.point[echoes.beam], "EchoNumber": number}
    columns |= features(echoes, beams, device)
    table = np.column_stack([np.asarray(c, np.float64) for c in columns.values()])
    if device.document.get("duplicate_return", "drop") == "repeat":
        table = _with_copies(table, echoes, list(columns).index("EchoNumber"))
    if "counts" in echoes.of_beams:
        table = np.concatenate([table, _empty(table.shape[1], echoes, beams, list(columns))])
    forms = ["%.6f" if name in ("X", "Y", "Z", "RANGE") else "%.0f" for name in columns]
    rows = "\n".join(" ".join(f % x for f, x in zip(forms, values, strict=True)) for values in table.tolist())
    return f"//{' '.join(columns)}\n{len(table)}\n{rows}\n"


def _with_copies(table: F, echoes: Echoes, number: int) -> F:
    """A beam with one echo reports it twice."""
    alone = np.bincount(echoes.beam, minlength=1)[echoes.beam] == 1
    copies = table[alone].copy()
    copies[:, number] = 2
    both = np.concatenate([table, copies])
    return both[np.argsort(np.concatenate([echoes.beam, echoes.beam[alone]]), kind="stable")]


def _empty(columns: int, echoes: Echoes, beams: Beams, names: list[str]) -> F:
    """Zones without an echo have a histogram all the same."""
    zones = np.setdiff1d(np.arange(len(beams)), echoes.beam)
    rows = np.zeros((len(zones), columns))
    rows[:, names.index("Layer")], rows[:, names.index("Point")] = beams.layer[zones], beams.point[zones]
    rows[:, names.index("EchoNumber")] = 1
    first = names.index("h0")
    counts = echoes.of_beams["counts"]
    rows[:, first : first + counts.shape[1]] = counts[zones]
    return rows
