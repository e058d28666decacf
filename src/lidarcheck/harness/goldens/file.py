"""Reading and writing goldens: TOML that a person can review, and that shows when a person has edited it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lidarcheck.config.toml_text import toml_of
from lidarcheck.config.words import shown
from lidarcheck.errors import GoldenError, InputError
from lidarcheck.formats.atomic import write_text
from lidarcheck.formats.source import decode_text, read_source
from lidarcheck.harness.gate import evidence
from lidarcheck.harness.goldens.golden import Golden, KpiGolden
from lidarcheck.harness.goldens.provenance import Provenance
from lidarcheck.harness.kpis.spec import KpiSpec
from lidarcheck.trust.places import check_place

__all__ = ["FORMAT", "dump_golden", "golden_of", "load_golden", "load_proposal", "refuse_proposal", "save_golden"]

FORMAT = 1
_HEAD = (
    "# What the KPIs of this scenario were when somebody last agreed to them. Written by `lidarcheck review`: do not\n"
    "# edit it, the content hash at the end would no longer fit.\n"
)
_PROPOSED = "proposed"
"""The key that only a proposal has."""
_PROPOSED_HEAD = (
    "# A proposal that a run has left: no golden. `lidarcheck review` shows it and accepts it; a copy of it among the\n"
    "# goldens is refused.\n"
)
_ANEW = "make it anew with `lidarcheck review --accept all`"
_RELEASE_ANEW = "make it anew from the last golden with `lidarcheck review --release`"
_SPEC_FIELDS = ("kind", "unit", "direction", "tolerance", "low", "high", "feature", "requirement")
_NUMBER_FIELDS = ("mean", "sd", "seeds", "drawn", "trials")
_WORDS = ("reason", "reason_date", "accepted_by", "accepted_date", "verdict")


def load_golden(path: Path, *, release: bool = False) -> Golden:
    """Read a golden; `GoldenError` if it is not TOML, not a golden, of another format, edited by hand, or a proposal.

    `release`: it is a release golden, which is made anew in another way.
    """
    golden = load_proposal(path, release=release)
    refuse_proposal(golden, path)
    return golden


def refuse_proposal(golden: Golden, path: Path) -> None:
    """`GoldenError` for a proposal that somebody has copied among the goldens, unreviewed."""
    if golden.is_proposal:
        fix = f"restore the golden from version control or delete it, then run `lidarcheck review {path.stem}`"
        raise GoldenError("this is a proposal, not a golden: nobody has accepted it", file=path, fix=fix)


def load_proposal(path: Path, *, release: bool = False) -> Golden:
    """Read a proposal, or a golden; `GoldenError` as `load_golden` has it, but for a proposal."""
    return golden_of(_text(path, _restore(release)), path, release=release)


def golden_of(text: str, path: Path, *, release: bool = False) -> Golden:
    """The golden or proposal of a file's text; `path` is named in errors, which are those of `load_proposal`."""
    anew, restore = _RELEASE_ANEW if release else _ANEW, _restore(release)
    document = _parse(text, path, restore)
    if document.get("format") != FORMAT:
        raise GoldenError(
            f"golden format {shown(document.get('format'))} is not {FORMAT}",
            file=path,
            fix=f"use the lidarcheck that wrote it, or {anew}",
        )
    try:
        content = document["provenance"].pop("content", None)
        if content != _content_hash(document):
            raise GoldenError("the golden was edited by hand: its content hash does not fit", file=path, fix=restore)
        return _golden(document)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise GoldenError(f"this is no golden: {type(error).__name__} {error}", file=path, fix=restore) from error


def save_golden(golden: Golden, path: Path) -> None:
    """Write the golden, whole or not at all."""
    write_text(path, dump_golden(golden))


def dump_golden(golden: Golden) -> str:
    """The golden's file content."""
    head: dict[str, Any] = {"format": FORMAT, "scenario": golden.scenario, "digests": list(golden.digests)}
    head |= {_PROPOSED: True} if golden.proposed else {}
    kpis = {name: _kpi_table(kpi) for name, kpi in golden.kpis.items()}
    provenance = _provenance_table(golden.provenance)
    provenance["content"] = _content_hash({**head, "kpis": kpis, "provenance": provenance})
    parts = [(_PROPOSED_HEAD if golden.proposed else _HEAD) + _lines(head)]
    parts += [f"[kpis.{_string(name)}]\n{_lines(table)}" for name, table in kpis.items()]
    parts += [f"[provenance]\n{_lines(provenance)}"]
    return "\n".join(parts)


def _restore(release: bool) -> str:
    return f"restore it from version control, or {_RELEASE_ANEW if release else _ANEW}"


def _text(path: Path, restore: str) -> str:
    try:
        check_place(path, path)
    except InputError as error:
        raise GoldenError(error.what, file=path, fix=error.fix) from None
    if not path.exists():
        raise GoldenError("there is no such golden", file=path, fix="make it with `lidarcheck review`")
    try:
        return decode_text(read_source(path), path)
    except InputError as error:
        raise GoldenError(error.what, file=path, line=error.line, fix=restore) from error


def _parse(text: str, path: Path, restore: str) -> dict[str, Any]:
    if not text.strip():
        raise GoldenError("the golden is empty", file=path, fix=restore)
    try:
        return toml_of(text, path)
    except InputError as error:
        raise GoldenError(error.what, file=path, line=error.line, fix=restore) from error


def _golden(document: Mapping[str, Any]) -> Golden:
    provenance = dict(document["provenance"])
    provenance["kept"] = tuple(provenance.get("kept", ()))
    return Golden(
        scenario=str(document["scenario"]),
        kpis={name: _kpi(name, table) for name, table in document.get("kpis", {}).items()},
        digests=tuple(document["digests"]),
        provenance=Provenance(**provenance),
        proposed=document.get(_PROPOSED) is True,
    )


def _kpi(name: str, table: Mapping[str, Any]) -> KpiGolden:
    null = tuple(float(value) for value in table.get("null", ()))
    if null and len(null) != len(evidence.NULL_LEVELS):
        raise ValueError(f"{name} has {len(null)} null quantiles, not {len(evidence.NULL_LEVELS)}")
    reference = evidence.Reference(
        mean=float(table["mean"]),
        sd=float(table["sd"]),
        seeds=int(table["seeds"]),
        drawn=int(table["drawn"]),
        paired=tuple(float(value) for value in table["paired"]),
        trials=float(table.get("trials", 0.0)),
        null=null,
    )
    spec = KpiSpec(name=name, **{field: table[field] for field in _SPEC_FIELDS if field in table})
    words = {word: str(table.get(word, "")) for word in _WORDS}
    return KpiGolden(spec, reference, tuple(float(value) for value in table.get("reference", ())), **words)


def _kpi_table(kpi: KpiGolden) -> dict[str, Any]:
    table = {field: getattr(kpi.spec, field) for field in _SPEC_FIELDS}
    table["requirement"] = kpi.spec.requirement or None
    table |= {field: getattr(kpi.reference, field) for field in _NUMBER_FIELDS}
    table["trials"] = kpi.reference.trials or None
    table["paired"] = list(kpi.reference.paired)
    if kpi.reference.null:
        table["null_levels"], table["null"] = list(evidence.NULL_LEVELS), list(kpi.reference.null)
    if kpi.quantiles:
        table["reference"] = list(kpi.quantiles)
    table |= {word: getattr(kpi, word) or None for word in _WORDS}
    return {name: value for name, value in table.items() if value is not None}


def _provenance_table(provenance: Provenance) -> dict[str, Any]:
    table = {field.name: getattr(provenance, field.name) for field in dataclasses.fields(provenance)}
    table["kept"] = list(table["kept"])
    return {name: value for name, value in table.items() if value or name not in ("kept", "base")}


def _content_hash(document: Mapping[str, Any]) -> str:
    """SHA-256 over what the document says, so that line ends, spaces and comments do not count."""
    return hashlib.sha256(json.dumps(_canonical(document), sort_keys=True).encode()).hexdigest()


def _canonical(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _canonical(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_canonical(item) for item in value]
    if isinstance(value, int | float) and not isinstance(value, bool):
        return _number(float(value))
    return value if isinstance(value, str | bool) else str(value)


def _lines(table: Mapping[str, Any]) -> str:
    return "".join(f"{name} = {_value(value)}\n" for name, value in table.items())


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, list):
        return _array(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value) if isinstance(value, int) else _number(value)


def _array(values: Sequence[Any]) -> str:
    words = [_value(value) for value in values]
    short = f"[{', '.join(words)}]"
    if len(short) <= 100:
        return short
    rows, row = [], ""
    for word in words:
        if row and len(row) + len(word) > 116:
            rows.append(row.rstrip())
            row = ""
        row += f"{word}, "
    return "[\n" + "".join(f"  {line}\n" for line in (*rows, row.rstrip())) + "]"


def _number(value: float) -> str:
    if math.isnan(value):
        return "nan"
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    text = repr(value)
    return text if "." in text or "e" in text else f"{text}.0"


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")
