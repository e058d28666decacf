"""The files of a proposed scenario: its model with the tables it names, its ideal scan, and the scenario itself."""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lidarcheck.errors import UsageError
from lidarcheck.formats.atomic import write_bytes, write_text
from lidarcheck.harness.layout import make_directory
from lidarcheck.harness.propose.trial import Catch, KpiTrial
from lidarcheck.model.files.model_file import save_model
from lidarcheck.model.spec import Model

__all__ = ["ideal_file", "model_file", "write_files"]


def model_file(scenario: Path) -> Path:
    """Where the model of a proposed scenario lies."""
    return scenario.parent / "models" / scenario.name


def ideal_file(scenario: Path, source: Path) -> Path:
    """Where its ideal scan lies, which is a copy of `source`."""
    return scenario.parent / "ideals" / f"{scenario.stem}{source.suffix}"


def write_files(
    trial: KpiTrial, catches: Mapping[str, tuple[Catch, ...]], tolerances: Mapping[str, float], description: str
) -> list[Path]:
    """Write all of them and return their paths, the scenario's last; where that fails, none of them is left."""
    scenario = trial.scenario.path
    model, ideal = model_file(scenario), ideal_file(scenario, trial.file)
    files: list[Path] = []
    try:
        for directory in (model.parent, ideal.parent):
            make_directory(directory)
        save_model(_with_tables_beside(trial.scenario.model, model, files), _new(model, files))
        write_bytes(_new(ideal, files), trial.file.read_bytes())
        names = {"model": f"{model.parent.name}/{model.name}", "ideal": f"{ideal.parent.name}/{ideal.name}"}
        head = [f"{key} = {_toml(value)}" for key, value in {"description": description, **names}.items()]
        lines = [line for kpi, tolerance in tolerances.items() for line in _kpi_lines(trial, kpi, tolerance, catches)]
        write_text(_new(scenario, files), "\n".join([*head, *lines]) + "\n")
    except BaseException:
        for path in files:
            path.unlink(missing_ok=True)
        raise
    return files


def _new(path: Path, files: list[Path]) -> Path:
    """A path that is written next, for which nothing may be there."""
    if path.exists():
        raise UsageError(f"{path} is there already", fix="give the scenario another name")
    files.append(path)
    return path


def _with_tables_beside(model: Model, file: Path, files: list[Path]) -> Model:
    """The model with the files that its effects name copied beside it, so that the scenario needs nothing else."""
    effects = []
    for effect in model.effects:
        moved: dict[str, Any] = {}
        for parameter in effect.files():
            curve = getattr(effect, parameter.name)
            if curve is not None:
                copy = _new(file.parent / f"{file.stem}_{effect.name}_{Path(curve.file).name}", files)
                shutil.copyfile(curve.file, copy)
                moved[parameter.name] = dataclasses.replace(curve, file=str(copy))
        effects.append(dataclasses.replace(effect, **moved) if moved else effect)
    return dataclasses.replace(model, effects=tuple(effects))


def _kpi_lines(trial: KpiTrial, kpi: str, tolerance: float, catches: Mapping[str, tuple[Catch, ...]]) -> list[str]:
    """One `[[kpis]]` table, and what it catches as comments."""
    seen = [(effect, catch) for effect, found in catches.items() for catch in found if catch.kpi == kpi]
    said = [
        f"# {effect}: {catch.present:.4g} with it, {catch.lost:.4g} without; {catch.margin:.1f} times what is caught"
        for effect, catch in seen
    ]
    table = {**trial.tables[kpi], "name": kpi, "tolerance": tolerance}
    return ["", *said, "[[kpis]]", *(f"{key} = {_toml(value)}" for key, value in table.items())]


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    return f"[{', '.join(map(_toml, value))}]" if isinstance(value, tuple) else repr(value)
