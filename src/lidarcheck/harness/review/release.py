"""What a release says of its goldens: which there are, how each was made, what has moved since the last release.

Reads only: scenarios' names, goldens, release goldens and, where there is one, the JSON of the last check.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarcheck.errors import GoldenError, InputError
from lidarcheck.formats.limits import RESULT_BYTES, check_bytes
from lidarcheck.harness.goldens.file import load_golden
from lidarcheck.harness.goldens.golden import Golden, KpiGolden
from lidarcheck.harness.goldens.provenance import Provenance, source_hash
from lidarcheck.harness.layout import Layout, layout_of, select

__all__ = ["GoldenState", "LastCheck", "Shift", "golden_states", "is_check", "last_check", "project_of"]


@dataclass(frozen=True, slots=True)
class Shift:
    """A KPI whose golden is another than at the last release; `release` or `now` is nan where there is none."""

    kpi: str
    unit: str
    release: float
    now: float
    tolerance: float
    reason: str = ""
    requirement: str = ""
    accepted_by: str = ""
    accepted_date: str = ""

    @property
    def change(self) -> float:
        """Now minus release."""
        return self.now - self.release

    @property
    def in_tolerances(self) -> float:
        """The change in tolerances."""
        return self.change / self.tolerance if self.tolerance > 0.0 else math.nan


@dataclass(frozen=True, slots=True)
class GoldenState:
    """One scenario's golden.

    `problem`: what is wrong with it, as that there is none, empty if nothing; `made`, `released`: how golden and
    release golden were made; `complete`: all seeds were run; `shifts`: since the last release; `verdict`: of the last
    check, "not run" where it did not run it; `fallen`: the KPIs that fell out there, with their verdict.
    """

    scenario: str
    kpis: int = 0
    problem: str = ""
    made: Provenance | None = None
    released: Provenance | None = None
    complete: bool = False
    shifts: tuple[Shift, ...] = ()
    reasons: tuple[str, ...] = ()
    verdict: str = "not run"
    fallen: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LastCheck:
    """A run of `lidarcheck check` as its JSON tells.

    `current`: the code that determines results is that of this installation; `scenarios`: verdict and fallen KPIs by
    scenario; `counts`: KPIs by verdict.
    """

    file: Path
    verdict: str
    current: bool
    seed: int | None
    model: str
    problems: tuple[str, ...]
    counts: Mapping[str, int]
    scenarios: Mapping[str, tuple[str, tuple[str, ...]]]


def project_of(goldens: Path | None) -> Layout | None:
    """The project that the goldens are of; `goldens`: it, its `goldens/` or its `scenarios/`.

    None given: that of the current directory or of the nearest above; None if there is none. `InputError`: what was
    given is no such directory.
    """
    if goldens is None:
        here = Path.cwd()
        found = next((place for place in (here, *here.parents) if (place / "scenarios").is_dir()), None)
        return None if found is None else layout_of(found / "scenarios" / "any.toml")
    if not goldens.is_dir():
        what = "is not a directory" if goldens.exists() else "there is no such directory"
        raise InputError(what, file=goldens, fix="give the directory that holds scenarios/ and goldens/")
    inside = goldens.resolve()
    root = inside.parent if inside.name in ("goldens", "scenarios") else inside
    layouts = select([root]).whole
    if not layouts or not (list(layouts[0].scenarios.glob("*.toml")) or layouts[0].goldens.is_dir()):
        raise InputError("holds no scenarios and no goldens", file=goldens, fix="give the directory that does")
    return layouts[0]


def golden_states(layout: Layout, check: LastCheck | None = None) -> tuple[GoldenState, ...]:
    """The state of every scenario's golden, by name, those without a golden and goldens without a scenario as well."""
    names = {path.stem for path in layout.scenarios.glob("*.toml") if not path.name.startswith(".")}
    orphans = {path.stem for path in layout.orphans()}
    return tuple(_state(layout, name, name in names, check) for name in sorted(names | orphans))


def _state(layout: Layout, name: str, asked: bool, check: LastCheck | None) -> GoldenState:
    verdict, fallen = check.scenarios.get(name, ("not run", ())) if check else ("not run", ())
    if not asked:
        return GoldenState(name, problem="the golden has no scenario", verdict=verdict, fallen=fallen)
    path, released = layout.golden(name), layout.release(name)
    if not path.is_file():
        return GoldenState(name, problem="there is no golden", verdict=verdict, fallen=fallen)
    try:
        golden = load_golden(path)
        release = load_golden(released, release=True) if released.is_file() else None
    except GoldenError as error:
        return GoldenState(name, problem=str(error.what), verdict=verdict, fallen=fallen)
    return GoldenState(
        scenario=name,
        kpis=len(golden.kpis),
        made=golden.provenance,
        released=release.provenance if release else None,
        complete=golden.complete,
        shifts=_shifts(golden, release) if release else (),
        reasons=tuple(dict.fromkeys(kpi.reason for kpi in golden.kpis.values() if kpi.reason)),
        verdict=verdict,
        fallen=fallen,
    )


def _shifts(golden: Golden, release: Golden) -> tuple[Shift, ...]:
    """The KPIs that differ, new and dropped ones as well; NaN in both is no difference."""
    shifts = []
    for name in dict.fromkeys((*golden.kpis, *release.kpis)):
        now, then = golden.kpis.get(name), release.kpis.get(name)
        known = now or then
        assert known is not None
        values = [math.nan if kpi is None else kpi.reference.mean for kpi in (then, now)]
        same = values[0] == values[1] or (now is not None and then is not None and all(map(math.isnan, values)))
        if not same:
            reason = now.reason if now else "no longer measured"
            shifts.append(Shift(name, known.spec.unit, values[0], values[1], known.spec.tolerance, reason, *_told(now)))
    return tuple(shifts)


def _told(kpi: KpiGolden | None) -> tuple[str, str, str]:
    """(requirement, who accepted it, when)."""
    return ("", "", "") if kpi is None else (kpi.spec.requirement, kpi.accepted_by, kpi.accepted_date)


def is_check(document: Any) -> bool:
    """Whether a JSON document is that of a check."""
    return isinstance(document, dict) and {"scenarios", "kpis_in_suite", "verdict", "counts"} <= document.keys()


def last_check(file: Path) -> LastCheck:
    """Read what `lidarcheck check --json` has written; `InputError` if it is not that."""
    fix = "give the file that `lidarcheck check --json FILE` wrote"
    try:
        check_bytes(file.stat().st_size, file, RESULT_BYTES)
        document = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read: {error.strerror or error}", file=file, fix=fix) from error
    except ValueError as error:
        raise InputError(f"is not JSON: {error}", file=file, fix=fix) from error
    if not is_check(document):
        raise InputError("is not the JSON of a check", file=file, fix=fix)
    try:
        return LastCheck(
            file=file,
            verdict=str(document["verdict"]),
            current=document.get("source") == source_hash(),
            seed=document.get("seed"),
            model=str(document.get("model") or ""),
            problems=tuple(map(str, document.get("problems", ()))),
            counts={str(word): int(count) for word, count in document["counts"].items() if count},
            scenarios={str(one["name"]): _verdict(one) for one in document["scenarios"]},
        )
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise InputError(f"is not the JSON of a check: {type(error).__name__} {error}", file=file, fix=fix) from error


def _verdict(scenario: Mapping[str, Any]) -> tuple[str, tuple[str, ...]]:
    kpis = scenario["kpis"]
    fallen = tuple(f"{kpi['name']}: {kpi['verdict']}" for kpi in kpis if kpi["fails"])
    problems = tuple(str(problem) for problem in scenario.get("problems", ()))
    if scenario["failed"]:
        return "failed", (*problems, *fallen)
    return ("identical" if scenario["identical"] else "holds") if kpis else "not run", ()
