"""Signs and ghosts as a page: tables over all datasets, and histograms, real against simulated where there is one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.echoes import features_of
from lidarcheck.calibration.ghosts.workflow import GHOST, SIGN, GhostScan, Sign
from lidarcheck.figures.data import Cloud, Course, Curve, Distribution, Figure, Page, Section, Table
from lidarcheck.figures.pages.ghost_steps import steps_section
from lidarcheck.figures.words import number
from lidarcheck.kpi.distances import wasserstein
from lidarcheck.sensor import SpadArray

__all__ = ["find_document", "find_page"]


NAMES = {SIGN: "sign", GHOST: "ghost"}
COUNTED = ("AREA", "PEAK")
"""What is shown of a SPAD array's echoes; of other sensors, all features."""
_ROWS = ("rows", "ghost_rows", "searched", "clusters")


def find_page(
    found: Sequence[GhostScan],
    simulated: Sequence[GhostScan] = (),
    provenance: Mapping[str, str] | None = None,
    *,
    steps: bool = False,
) -> Page:
    """What was found in each dataset; `simulated`: the same of simulated scans, one a dataset, or none.

    `steps`: also what each step of the extraction holds.
    """
    tables, courses = (_signs_table(found), _ratios_table(found)), tuple(_courses(found, simulated))
    sections = [
        Section("Signs and ghosts", tables=tables, figures=courses),
        *(_compared(found, simulated) if simulated else ()),
        *(_dataset(one, None if not simulated else simulated[i]) for i, one in enumerate(found)),
        *(steps_section(one) for one in found if steps),
    ]
    return Page("Signs and ghosts", _summary(found), tuple(sections), provenance or {})


def find_document(found: Sequence[GhostScan]) -> list[dict[str, Any]]:
    """The numbers, without the echoes: what `result.json` has of each dataset."""
    return [
        {
            "name": one.name,
            "echoes": len(one.scan),
            "sign_echoes": int(np.count_nonzero(one.label == SIGN)),
            "ghost_echoes": int(np.count_nonzero(one.label == GHOST)),
            "variant": None if one.sensor is None else one.sensor.variant,
            "bright": {"column": one.brightness.column, "above": one.brightness.above, "why": one.brightness.why},
            "signs": [_sign_document(one, sign) for sign in one.signs],
            "notes": one.notes,
        }
        for one in found
    ]


def _sign_document(one: GhostScan, sign: Sign) -> dict[str, Any]:
    values = {name: getattr(sign, name) for name in sign.__dataclass_fields__ if name not in _ROWS}
    counts = {"echoes": len(sign.rows), "ghosts": len(sign.ghost_rows)}
    medians = {
        f"{label}_{column}_median": float(np.median(values[rows])) if len(rows) else None
        for label, rows in (("sign", sign.rows), ("ghost", sign.ghost_rows))
        for column, values in _columns(one).items()
    }
    return counts | values | medians


def _columns(one: GhostScan) -> Mapping[str, FloatArray]:
    """The features of a dataset's echoes, by their names in `result.json`."""
    if _is_counted(one):
        return {"area": one.scan.area, "peak": one.scan.peak, "width_ns": one.scan.width_ns}
    return {name: values for name, (_, values) in features_of(one.scan, one.sensor).items()}


def _is_counted(one: GhostScan) -> bool:
    return one.sensor is None or isinstance(one.sensor, SpadArray)


def _shown(one: GhostScan) -> list[str]:
    """The features of which there is a picture."""
    found = features_of(one.scan, one.sensor)
    return [name for name in COUNTED if name in found] if _is_counted(one) else list(found)


def _names(found: Sequence[GhostScan]) -> tuple[str, ...]:
    """What the ratios of strength are called: by what echoes are told bright, and PEAK where there is one."""
    told = dict.fromkeys(one.brightness.column for one in found if not _is_counted(one)) or {"AREA": None}
    return (" or ".join(told), *(["PEAK"] if any(map(_is_counted, found)) else ()))


def _summary(found: Sequence[GhostScan]) -> str:
    with_ghost = [one for one in found if any(sign.has_ghost for sign in one.signs)]
    signs, ghosts = (sum(int(np.count_nonzero(one.label == label)) for one in found) for label in (SIGN, GHOST))
    count = sum(len(one.signs) for one in found)
    of = f"{_count(count, 'sign')} ({_count(signs, 'echo', 'echoes')}) in {_count(len(found), 'dataset')}"
    if not with_ghost:
        return f"No ghost: {of}, and nothing at twice the range that chance does not give."
    rest = "" if len(with_ghost) == len(found) else f", in {len(with_ghost)} of them with a ghost"
    return f"{of}{rest}; {_count(ghosts, 'ghost echo', 'ghost echoes')}."


def _count(count: int, one: str, many: str = "") -> str:
    return f"{count} {one if count == 1 else many or one + 's'}"


def _each(found: Sequence[GhostScan]) -> list[tuple[GhostScan, int, Sign]]:
    return [(one, i, sign) for one in found for i, sign in enumerate(one.signs, start=1)]


def _signs_table(found: Sequence[GhostScan]) -> Table:
    header = ("dataset", "sign", "range [m]", "size [m]", "sign echoes", "ghosts", "2R + [m]", "seen on beams", "95 %")
    rows = [
        (
            *(one.name, str(i), f"{sign.range_m:.2f}", f"{sign.width_m:.2f} x {sign.height_m:.2f}"),
            *(str(len(sign.rows)), str(len(sign.ghost_rows)), number(sign.offset_m, ".2f")),
            f"{100 * sign.fraction:.0f} %",
            f"{100 * sign.fraction_low:.0f} ... {100 * sign.fraction_high:.0f} %",
        )
        for one, i, sign in _each(found)
    ]
    return Table("What was found", header, tuple(rows), tuple(header[2:]))


def _ratios_table(found: Sequence[GhostScan]) -> Table:
    own, *peak = _names(found)
    medians = (f"sign {own}", f"ghost {own}", *(f"ghost {name}" for name in peak))
    header = ("dataset", "sign", "count", own, *peak, "range", "size", *medians)
    rows = []
    for one, i, sign in _each(found):
        ratio = sign.ratio
        rows.append((
            *(one.name, str(i), number(ratio.count_ratio, ".3f"), number(ratio.area_ratio, ".4f")),
            *((number(ratio.peak_ratio, ".4f"),) if peak else ()),
            *(number(ratio.range_ratio, ".4f"), number(ratio.size_ratio, ".2f")),
            *(_median(one.brightness.values, sign.rows), _median(one.brightness.values, sign.ghost_rows)),
            *((_median(one.scan.peak, sign.ghost_rows),) if peak else ()),
        ))  # fmt: skip
    return Table("Ghost over sign, and medians", header, tuple(rows), tuple(header[2:]))


def _median(values: FloatArray, rows: npt.NDArray[np.int64]) -> str:
    return f"{np.median(values[rows]):.0f}" if len(rows) else "-"


def _courses(found: Sequence[GhostScan], simulated: Sequence[GhostScan]) -> list[Figure]:
    """How often a ghost is seen, how bright it is, and ghost over sign, over the sign's range; for several signs."""
    sides = {"real": _by_range(found), "simulated": _by_range(simulated)}
    if len(sides["real"]) < 2:
        return []
    column, at = sides["real"][0][0].brightness.column, "range of the sign [m]"
    shown = {name: signs for name, signs in sides.items() if signs}
    fields = dict(zip(_names(found), ("area_ratio", "peak_ratio"), strict=False))
    strengths = {"count": "count_ratio", **fields}
    return [
        Course("Beams of the sign with a ghost", at, "share", tuple(_shares(n, s) for n, s in shown.items())),
        Course(
            f"{column} of the ghosts", at, f"median {column}", tuple(_medians(n, s) for n, s in shown.items()),
            log_y=True,
        ),
        Course("Ghost over sign: count and strength", at, "ratio", _over_sign(shown, strengths), log_y=True),
        Course("Ghost over sign: range and size", at, "ratio", _over_sign(shown, _LENGTHS)),
    ]  # fmt: skip


_LENGTHS = {"range": "range_ratio", "size": "size_ratio"}
_Signs = list[tuple[GhostScan, int, Sign]]


def _by_range(found: Sequence[GhostScan]) -> _Signs:
    return sorted(_each(found), key=lambda entry: entry[2].range_m)


def _ranges(signs: _Signs) -> FloatArray:
    return np.array([sign.range_m for *_, sign in signs])


def _shares(name: str, signs: _Signs) -> Curve:
    seen, low, high = (
        np.array([getattr(s, f) for *_, s in signs]) for f in ("fraction", "fraction_low", "fraction_high")
    )
    return Curve(name, _ranges(signs), seen, low, high)


def _medians(name: str, signs: _Signs) -> Curve:
    """With the quartiles as the interval."""
    area = [one.brightness.values[sign.ghost_rows] for one, _, sign in signs]
    quartiles = [np.array([np.quantile(a, q) if len(a) else np.nan for a in area]) for q in (0.5, 0.25, 0.75)]
    return Curve(name, _ranges(signs), *quartiles)


def _over_sign(sides: Mapping[str, _Signs], ratios: Mapping[str, str]) -> tuple[Curve, ...]:
    """A curve for each ratio and side; zeros, as of a sign without ghost, are gaps: they have no logarithm."""
    curves = []
    for side, signs in sides.items():
        for name, field in ratios.items():
            values = np.array([getattr(sign.ratio, field) for *_, sign in signs])
            label = f"{side}, {name}" if len(sides) > 1 else name
            curves.append(Curve(label, _ranges(signs), np.where(values > 0.0, values, np.nan)))
    return tuple(curves)


def _dataset(one: GhostScan, simulated: GhostScan | None) -> Section:
    told = one.brightness
    words = [f"Bright is {told.column} from {told.above:.0f} on ({told.why}). {'; '.join(one.notes)}".strip()]
    both: list[Figure] = []
    compared: list[Figure] = []
    for column in _shown(one) or ["amplitude"]:
        quantity = told.column if column == "amplitude" else column
        samples = _filled({name: one.values(label, column) for label, name in NAMES.items()})
        both.append(Distribution(f"{one.name}: {quantity} of sign and ghost", quantity, "", samples, log_x=True))
        compared += _side_by_side(one, simulated, column, quantity) if simulated is not None else []
    xyz = np.column_stack([one.scan.x_m, one.scan.y_m, one.scan.z_m])
    groups = _filled({name: xyz[one.label == label] for label, name in NAMES.items()})
    cloud = Cloud(f"{one.name}: sign and ghost", groups)
    return Section(one.name, tuple(words), figures=(*both, *compared, cloud))


def _side_by_side(one: GhostScan, simulated: GhostScan, column: str, quantity: str) -> list[Figure]:
    """Sign and ghost, each real against simulated where both have echoes of it."""
    figures: list[Figure] = []
    for label, name in NAMES.items():
        samples = {"real": one.values(label, column), "simulated": simulated.values(label, column)}
        if all(len(values) for values in samples.values()):
            figures.append(Distribution(f"{one.name}: {quantity} of the {name}", quantity, "", samples))
    return figures


def _filled(samples: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Those that hold something."""
    return {name: values for name, values in samples.items() if len(values)}


def _compared(found: Sequence[GhostScan], simulated: Sequence[GhostScan]) -> tuple[Section]:
    """Counts and means of real and simulated side by side, and how far the distributions lie apart."""
    header = ("dataset", "of", "", "real", "simulated", "distance")
    rows = []
    for one, other in zip(found, simulated, strict=True):
        for label, name in NAMES.items():
            counts = [int(np.count_nonzero(s.label == label)) for s in (one, other)]
            rows.append((one.name, name, "echoes", *map(str, counts), "-"))
            for quantity in _shown(one) if not _is_counted(one) else COUNTED:
                real, sim = (s.values(label, quantity) for s in (one, other))
                means = [f"{v.mean():.1f}" if len(v) else "-" for v in (real, sim)]
                rows.append((one.name, name, f"{quantity}, mean", *means, number(wasserstein(real, sim), ".1f")))
    words = ("The distance is the 1-Wasserstein distance of the two distributions, in the quantity's own unit.",)
    table = Table("", header, tuple(rows), header[3:])
    return (Section("Real and simulated", words, (table,)),)
