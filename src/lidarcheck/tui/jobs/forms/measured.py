"""The forms of commands about one measurement: simulate, compare, calibrate, the fit of ghosts, explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lidarcheck.cases.case import CASE_FILE, case_model
from lidarcheck.errors import LidarcheckError, UsageError
from lidarcheck.session.measurements import Measurement, measurements
from lidarcheck.session.pairing import is_simulated
from lidarcheck.session.project import Project
from lidarcheck.session.runs import Plan
from lidarcheck.tui.jobs.forms.form import CommandForm, Field, Values, as_argument, chosen, option, text_of

__all__ = [
    "Looked",
    "calibrate_form",
    "compare_form",
    "explain_form",
    "ghosts_form",
    "measured_of",
    "simulate_form",
]

_OWN = "this measurement: "


def measured_of(project: Project) -> list[Measurement]:
    """The scans and sets of frames of a project, which commands are given by their files."""
    return [one for one in measurements(project) if one.kind not in ("profile", "case", "bag") and one.files]


@dataclass(frozen=True)
class Looked:
    """What is looked at. `model`: its name in the project, empty for none; `at`: the measurement's, likewise."""

    project: Project
    measured: Sequence[Measurement]
    model: str = ""
    at: str = ""

    @property
    def models(self) -> tuple[str, ...]:
        """The names of the sound models."""
        return tuple(entry.name for entry in self.project.of("model"))

    def first_model(self) -> tuple[str, ...]:
        """The one that is chosen, else the only one."""
        if self.model in self.models:
            return (self.model,)
        return self.models if len(self.models) == 1 else ()

    def one(self, name: str) -> Measurement:
        """A measurement by its name."""
        found = next((one for one in self.measured if one.name == name), None)
        if found is None:
            raise UsageError("a measurement is not chosen", fix="choose it above")
        return found

    def names(self, *, ideal: bool = False) -> tuple[str, ...]:
        """Of all measurements, or of those with an ideal scan."""
        return tuple(one.name for one in self.measured if one.ideal or not ideal)

    def arguments(self, paths: Sequence[Path]) -> tuple[str, ...]:
        """Files as the command is given them."""
        return tuple(as_argument(path, self.project) for path in paths)

    def reads(self, values: Values) -> list[Path]:
        """The model that is chosen."""
        name = text_of(values, "model")
        return [self.project.root / name] if name else []


def _start(names: Sequence[str], at: str) -> tuple[str, ...]:
    return (at,) if at in names else tuple(names[:1])


def _model_field(looked: Looked) -> Field:
    return Field("model", "model", looked.models)


def _seed_field() -> Field:
    return Field("seed", "seed", about="0 to 2^64 - 1; empty: 0")


def _model_option(values: Values) -> tuple[str, str]:
    return "--model", chosen(values, "model", "a model")[0]


def simulate_form(looked: Looked) -> CommandForm:
    """`simulate`: the ideal scan of a measurement to a file beside the project's others."""
    names = looked.names(ideal=True)
    start = _start(names, looked.at)
    fields = (
        Field("of", "ideal scan of", names),
        _model_field(looked),
        Field("fidelity", "fidelity", ("exact", "fast", "reference"), about="fast: from a library, other bytes"),
        _seed_field(),
        Field("to", "to", about="a new file: .txt, .csv, .pcd, .las, .laz, .ply or .parquet; of frames a directory"),
    )
    to = f"{Path(start[0]).with_suffix('').name}_sim.parquet" if start else "sim.parquet"
    values = {"of": start, "model": looked.first_model(), "fidelity": ("exact",), "seed": ("",), "to": (to,)}

    def make(given: Values, _directory: str) -> Plan:
        one, to = (
            looked.one(text_of(given, "of")),
            as_argument(chosen(given, "to", "a file")[0].strip(), looked.project),
        )
        if (looked.project.root / to).exists():
            raise UsageError(f"{to} is there already", fix="give another name")
        ideals = looked.arguments(tuple(dict.fromkeys(one.ideal)))
        fidelity = text_of(given, "fidelity")
        step = (
            *("simulate", *ideals, *_model_option(given)),
            *option("--fidelity", "" if fidelity == "exact" else fidelity),
            *option("--seed", text_of(given, "seed").strip()),
            *("--out", to),
        )
        return Plan("simulate", (step,), to, {"file": to})

    return CommandForm("Simulate to a file", fields, values, make, looked.reads)


def compare_form(looked: Looked) -> CommandForm:
    """`compare`: a measurement with a simulated scan of the project."""
    scans = looked.project.of("scan")
    simulated = tuple(entry.name for entry in scans if is_simulated(entry)) or tuple(entry.name for entry in scans)
    names = looked.names()
    fields = (
        Field("of", "measured", names),
        Field("to", "simulated", simulated, about="simulate writes one"),
        Field("model", "model", ("", *looked.models), about="says the sensor, and the target of ghosts"),
    )
    values = {"of": _start(names, looked.at), "to": simulated[:1], "model": looked.first_model() or ("",)}

    def make(given: Values, directory: str) -> Plan:
        one = looked.one(text_of(given, "of"))
        if len(one.files) > 1:
            raise UsageError(
                f"{one.name} has {len(one.files)} frames", fix="compare takes a scan; scenes compare frames"
            )
        other = as_argument(chosen(given, "to", "a simulated scan")[0], looked.project)
        step = (
            *("compare", *looked.arguments(one.files), other),
            *(("--ideal", *looked.arguments(one.ideal[:1])) if one.ideal else ()),
            *option("--model", text_of(given, "model")),
            *("--json", f"{directory}/result.json"),
        )
        return Plan("compare", (step,), f"{directory}/result.json", {"words": ""})

    return CommandForm("Compare with a simulated scan", fields, values, make, looked.reads)


def ghosts_form(looked: Looked) -> CommandForm:
    """`ghosts fit`: signs and their ghosts at several ranges."""
    names = looked.names(ideal=True)
    fields = (
        Field("scans", "signs", names, True, "fitted together; each needs its ideal scan"),
        _model_field(looked),
        Field("bright", "least AREA", about="of a sign's echo; empty: by the sensor"),
        _seed_field(),
    )
    from lidarcheck.tui.jobs.ghosts import sign_scans

    of_signs = {scan.path for scan in sign_scans(looked.project)}
    signs = tuple(one.name for one in looked.measured if one.ideal and of_signs.issuperset(one.files))
    values = {"scans": signs, "model": looked.first_model(), "bright": ("",), "seed": ("",)}

    def make(given: Values, directory: str) -> Plan:
        found = [looked.one(name) for name in chosen(given, "scans", "a sign")]
        model = _model_option(given)
        step = (
            *("ghosts", "fit", *(name for one in found for name in looked.arguments(one.files))),
            *("--ideal", *(name for one in found for name in looked.arguments(one.ideal)), *model),
            *option("--bright", text_of(given, "bright").strip()),
            *option("--seed", text_of(given, "seed").strip()),
            *("--out", f"{directory}/out"),
        )
        return Plan("ghosts fit", (step,), f"{directory}/out/result.json", _for_model(model[1], directory))

    return CommandForm("Fit the ghosts", fields, values, make, looked.reads)


def calibrate_form(looked: Looked) -> CommandForm:
    """`calibrate`: named numbers of the model, to a case or to the measurement that is chosen."""
    cases = tuple(entry.name for entry in looked.project.of("case"))
    own = (f"{_OWN}{looked.at}",) if looked.at in looked.names(ideal=True) else ()
    fields = (
        Field("case", "measured", (*own, *cases)),
        Field("model", "model", looked.models, about="of a case its own"),
        Field("free", "to fit", about="with commas: signal_at_1m, materials.1.reflectance, effects.NAME.PARAMETER"),
        Field("rounds", "rounds at most", about="1 to 50"),
        _seed_field(),
    )
    start = (own or cases)[:1]
    values = {
        "case": start, "model": looked.first_model(), "free": ("signal_at_1m,pulse_fwhm_ns",), "rounds": ("8",),
        "seed": ("",),
    }  # fmt: skip

    def make(given: Values, directory: str) -> Plan:
        name = chosen(given, "case", "a case")[0]
        steps: list[tuple[str, ...]] = []
        if name.startswith(_OWN):
            case, model = f"{directory}/case", chosen(given, "model", "a model")[0]
            steps.append(_make_case(looked, name.removeprefix(_OWN), model, case))
            source = f"{case}/{Path(model).name}"
        else:
            case, model = name, _model_of(looked.project, name)
            source = model
        rounds = text_of(given, "rounds").strip()
        steps.append(
            (
                *("calibrate", case, "--free", ",".join(chosen(given, "free", "what to fit"))),
                *option("--rounds", "" if rounds == "8" else rounds),
                *option("--seed", text_of(given, "seed").strip()),
                *("--out", f"{directory}/out"),
            )
        )
        takes = {**_for_model(model, directory), "source": source}
        return Plan("calibrate", tuple(steps), f"{directory}/out/result.json", takes)

    def reads(given: Values) -> list[Path]:
        name = text_of(given, "case")
        own = name.startswith(_OWN) or not name
        return looked.reads(given) if own else [looked.project.root / _model_of(looked.project, name)]

    return CommandForm("Calibrate the model", fields, values, make, reads)


def explain_form(looked: Looked) -> CommandForm:
    """A case of the measurement that is chosen, which Explain then explains."""
    names = looked.names(ideal=True)
    start = _start(names, looked.at)
    fields = (
        Field("of", "measured", names),
        _model_field(looked),
        Field("to", "case", about="a new directory of the project"),
    )
    to = f"cases/{Path(start[0]).with_suffix('').name or 'frames'}" if start else "cases/one"
    values = {"of": start, "model": looked.first_model(), "to": (to,)}

    def make(given: Values, _directory: str) -> Plan:
        to = as_argument(chosen(given, "to", "a directory")[0].strip(), looked.project)
        if (looked.project.root / to).exists():
            raise UsageError(f"{to} is there already", fix="give another name, or explain it on Explain")
        model = chosen(given, "model", "a model")[0]
        step = _make_case(looked, text_of(given, "of"), model, to)
        return Plan("case make", (step,), f"{to}/{CASE_FILE}", {"case": f"{to}/{CASE_FILE}", "of": model})

    return CommandForm("Explain this measurement", fields, values, make, looked.reads)


def _make_case(looked: Looked, name: str, model: str, to: str) -> tuple[str, ...]:
    one = looked.one(name)
    if not one.ideal:
        raise UsageError(f"{name} has no ideal scan", fix="name it like the scan, with ideal in the place of real")
    ideals = looked.arguments(tuple(dict.fromkeys(one.ideal)))
    return (
        "case",
        "make",
        "--measured",
        *looked.arguments(one.files),
        "--ideal",
        *ideals,
        "--model",
        model,
        "--out",
        to,
    )


def _model_of(project: Project, case: str) -> str:
    """The model that a case names."""
    try:
        return as_argument(case_model(project.root / case, fewest=1), project)
    except LidarcheckError as error:
        raise UsageError(error.lines()[0].removeprefix("error: "), fix="choose another case") from error


def _for_model(model: str, directory: str) -> dict[str, str]:
    return {"model": model, "fitted": f"{directory}/out/model.toml"}
