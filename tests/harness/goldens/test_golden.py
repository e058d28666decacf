"""Golden files: they read back as written, show what a hand has done, and are judged fairly."""

import dataclasses
import math
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harness_fakes import SPECS, Project
from lidarcheck.effects import catalogue, make
from lidarcheck.effects.base import Curve
from lidarcheck.effects.finding import empirical_terms, find
from lidarcheck.errors import GoldenError, InputError
from lidarcheck.harness.gate import evidence
from lidarcheck.harness.gate.seeds import (
    GOLDEN_SEEDS,
    QUANTILE_LEVELS,
    REFERENCE_SEEDS,
    SeedRecord,
    distance,
    fresh_seeds,
    quantile_function,
    record_of,
)
from lidarcheck.harness.goldens.file import dump_golden, load_golden, load_proposal, save_golden
from lidarcheck.harness.goldens.git_state import uncommitted
from lidarcheck.harness.goldens.golden import Golden, build, paired_identical, thresholds_changed, values_of
from lidarcheck.harness.goldens.hash_words import hashed_parts
from lidarcheck.harness.goldens.provenance import (
    NO_RESULTS,
    Provenance,
    external_files,
    hash_of,
    package_directory,
    parameters_hash,
    source_files,
)
from lidarcheck.harness.scenario.scenario import load_scenario
from lidarcheck.model.spec import External, Model
from lidarcheck.sensor import Material, NonIdeal, Sensor, shipped
from places import ROOT

SENSOR = Sensor.of("SMART", dead_bins=60)
TOOL = External(("./run",), Path())
PROVENANCE = Provenance("a", "b", "c", "0-63", "64-95", "3.11.1", "2.1.0", "0.61", "0.1.0", "2026-11-21")


@pytest.fixture
def records(tmp_path: Path) -> list[SeedRecord]:
    project = Project(tmp_path)
    scenario = project.load(project.file("one"))
    return [record_of(project.measure(scenario, project.model, seed)) for seed in (*GOLDEN_SEEDS, *REFERENCE_SEEDS)]


@pytest.fixture
def golden(records: list[SeedRecord]) -> Golden:
    return build("one", SPECS, records[:64], records[64:], PROVENANCE)


def test_reads_back_as_written(golden: Golden, tmp_path: Path) -> None:
    save_golden(golden, tmp_path / "one.toml")
    assert load_golden(tmp_path / "one.toml") == golden
    assert dump_golden(load_golden(tmp_path / "one.toml")) == dump_golden(golden)


def test_odd_names_and_numbers_read_back(golden: Golden, tmp_path: Path) -> None:
    kpi = golden.kpis["area_mean"]
    name = 'müde "\\ name\x7f\t, with = [signs]'
    reference = dataclasses.replace(kpi.reference, mean=math.inf, sd=1e-300, paired=(1e22, -0.0, 3.0), trials=2.5)
    odd = dataclasses.replace(
        kpi, spec=dataclasses.replace(kpi.spec, name=name, low=-5.0), reference=reference, reason="because, so"
    )
    kept = tuple(f"a name with spaces {i}" for i in range(20))
    written = dataclasses.replace(
        golden, kpis={name: odd}, provenance=dataclasses.replace(PROVENANCE, kept=kept, base="x")
    )
    save_golden(written, tmp_path / "one.toml")
    assert load_proposal(tmp_path / "one.toml") == written


def test_lines_stay_readable(golden: Golden) -> None:
    text = dump_golden(golden)
    assert max(map(len, text.splitlines())) <= 120
    assert text.index("[provenance]") > text.rindex("[kpis.")


def test_spaces_comments_and_line_ends_are_no_edit(golden: Golden, tmp_path: Path) -> None:
    text = dump_golden(golden).replace("mean = ", "mean  =  ").replace("\n", "\r\n") + "# seen by me\r\n"
    (tmp_path / "one.toml").write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert load_golden(tmp_path / "one.toml") == golden


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("tolerance = 1.0", "tolerance = 2.0", "edited by hand"),
        ('direction = "target"', 'direction = "higher"', "edited by hand"),
        ("seeds = 64", "seeds = 65", "edited by hand"),
        ("format = 1", "format = 2", "format 2 is not 1"),
        ("[provenance]", "[provenence]", "no golden"),
        ("content = ", "contents = ", "edited by hand"),
        ("format = 1", "<<<<<<< HEAD", "not valid TOML"),
        ("format = 1", "format = 1\nformat = 1", "not valid TOML"),
        ("seeds = 64", "seeds = 6" + "4" * 400, "no golden"),
        ("seeds = 64", "seeds = 6" + "4" * 5000, "not valid TOML: exceeds the limit"),
        ("format = 1", "format = 1\n" + "a." * 50_000 + "b = 1", "a key of more than 100 parts"),
        ("format = 1", "format = 1\na = " + "[" * 90 + "]" * 90, "edited by hand"),
        ("seeds = 64", "seeds = inf", "edited by hand"),
    ],
)
def test_a_changed_golden_is_refused(golden: Golden, tmp_path: Path, old: str, new: str, what: str) -> None:
    path = tmp_path / "one.toml"
    path.write_text(dump_golden(golden).replace(old, new, 1), encoding="utf-8")
    with pytest.raises(GoldenError, match=what) as caught:
        load_golden(path)
    assert len(caught.value.lines()) == 1
    assert str(path) in str(caught.value)
    assert "lidarcheck" in caught.value.fix


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe\x00", b"format = 1\n", b"format = 1\nprovenance = 3\n", b"[[kpis]]\n"]
)
def test_what_is_no_golden_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.toml").write_bytes(content)
    with pytest.raises(GoldenError):
        load_golden(tmp_path / "x.toml")


def test_a_truncated_golden_is_refused(golden: Golden, tmp_path: Path) -> None:
    text = dump_golden(golden)
    for cut in range(0, len(text) - 1, 97):
        (tmp_path / "x.toml").write_text(text[:cut], encoding="utf-8")
        with pytest.raises(GoldenError):
            load_golden(tmp_path / "x.toml")


def test_a_missing_golden_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GoldenError, match="no such golden"):
        load_golden(tmp_path / "x.toml")
    with pytest.raises(GoldenError, match="is a directory"):
        load_golden(tmp_path)


def test_numbers_of_a_golden(golden: Golden, records: list[SeedRecord]) -> None:
    values = [record.values["area_mean"] for record in records[:64]]
    reference = golden.kpis["area_mean"].reference
    assert reference.mean == pytest.approx(np.mean(values))
    assert reference.sd == pytest.approx(np.std(values, ddof=1))
    assert (reference.seeds, reference.drawn, len(reference.paired)) == (64, 64, 8)
    assert golden.kpis["detection"].reference.trials == 1000
    assert len(golden.kpis["area_distance"].quantiles) == QUANTILE_LEVELS
    assert golden.kpis["area_distance"].reference.null[-1] > golden.kpis["area_distance"].reference.null[0] > 0
    assert golden.complete


def test_values_that_are_not_numbers_are_counted_out(records: list[SeedRecord]) -> None:
    records = [dataclasses.replace(record, values={"area_mean": math.nan}) for record in records[:3]] + records[3:]
    reference = build("one", SPECS[:1], records[:64], [], PROVENANCE).kpis["area_mean"].reference
    assert (reference.seeds, reference.drawn) == (61, 64)
    assert math.isfinite(reference.mean)
    assert math.isnan(reference.paired[0])


def test_a_kpi_that_nothing_measured_is_left_out(records: list[SeedRecord]) -> None:
    assert "other" not in build("one", [dataclasses.replace(SPECS[0], name="other")], records, [], PROVENANCE).kpis


def test_paired_identity(golden: Golden, records: list[SeedRecord]) -> None:
    kpis = golden.kpis.values()
    assert all(paired_identical(golden, kpi, records[:8]) for kpi in kpis)
    assert not any(paired_identical(golden, kpi, records[1:9]) for kpi in kpis)
    recomputed = [dataclasses.replace(record, values={"area_mean": 1.0, "detection": 1.0}) for record in records[:8]]
    assert not paired_identical(golden, golden.kpis["area_mean"], recomputed)


def test_the_null_of_a_distance_is_honest(tmp_path: Path) -> None:
    # Fresh seeds exceed the null's 95 % as often as exchangeability says: the reference holds none of the null's seeds.
    project = Project(tmp_path)
    rates = []
    for suite in range(30):
        project.stream = suite
        scenario = project.load(project.file("one"))
        made = [record_of(project.measure(scenario, project.model, seed)) for seed in range(96 + 64)]
        kpi = build("one", SPECS, made[:64], made[64:96], PROVENANCE).kpis["area_distance"]
        edge = kpi.reference.null[evidence.NULL_LEVELS.index(0.95)]
        rates.append(np.mean([value > edge for value in values_of(kpi, made[96:])]))
    assert np.mean(rates) == pytest.approx(4 / 65, abs=0.02)


def test_thresholds_changed() -> None:
    spec = SPECS[1]
    assert thresholds_changed(spec, spec) == ""
    looser = dataclasses.replace(spec, tolerance=0.02, low=None)
    assert thresholds_changed(spec, looser) == "tolerance 0.01 is now 0.02, low 0.8 is now none"


def test_quantile_function() -> None:
    rng = np.random.default_rng(1)
    sample = rng.normal(0.0, 1.0, 5000)
    shifted = quantile_function(sample + 0.25)
    assert distance(quantile_function(sample), shifted) == pytest.approx(0.25)
    assert np.isnan(quantile_function(np.array([]))).all()
    assert np.isnan(quantile_function(np.array([1.0, np.nan]))).all()
    assert (quantile_function(np.array([3.0])) == 3.0).all()
    assert quantile_function(np.arange(QUANTILE_LEVELS)).tolist() == list(range(QUANTILE_LEVELS))


def test_fresh_seeds_are_none_of_the_goldens() -> None:
    drawn = [fresh_seeds(number, 64) for number in (None, 0, 1, -5, 2**80)]
    assert all(len(set(seeds)) == 64 for seeds in drawn)
    assert len({seed for seeds in drawn for seed in seeds}) == 5 * 64
    assert not {seed for seeds in drawn for seed in seeds} & {*GOLDEN_SEEDS, *REFERENCE_SEEDS}
    assert fresh_seeds(3, 16) == fresh_seeds(3, 64)[:16]


def test_source_hash_sees_results_alone(tmp_path: Path) -> None:
    package = tmp_path / "lidarcheck"
    for name in (
        "model/kernel.py",
        "cli/core/main.py",
        "tui/app.py",
        "figures/html.py",
        "harness/scenario/measure.py",
        "harness/check.py",
        "harness/gate/gate.py",
        "harness/gates.py",
        "brand_new/of_tomorrow.py",
        "__main__.py",
    ):
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text("a = 1\n", encoding="utf-8")
    names = [path.relative_to(package).as_posix() for path in source_files(package)]
    new, results = "brand_new/of_tomorrow.py", ["harness/scenario/measure.py", "model/kernel.py"]
    assert names == [new, "harness/check.py", "harness/gate/gate.py", "harness/gates.py", *results]
    before = hash_of(package)
    (package / "model/kernel.py").write_bytes(b"a = 1\r\n")
    (package / "tui/app.py").write_text("a = 2\n", encoding="utf-8")
    assert hash_of(package) == before
    (package / "model/kernel.py").write_text("a = 2\n", encoding="utf-8")
    assert hash_of(package) != before


def test_what_the_source_hash_leaves_out_is_there() -> None:
    assert [name for name in NO_RESULTS if not (package_directory() / name).exists()] == []


def test_parameters_hash(tmp_path: Path) -> None:
    model = Model(Sensor.of("SMART"), {1: Material("wall", 0.5), 0: Material("road", 0.1)}, file=tmp_path / "a.toml")
    moved = dataclasses.replace(model, materials=dict(reversed(model.materials.items())), file=None)
    assert parameters_hash(moved) == parameters_hash(model)
    assert parameters_hash(model.with_sensor(signal_at_1m=6180.0)) != parameters_hash(model)
    (tmp_path / "x.ini").write_text("a=1", encoding="utf-8")
    external = dataclasses.replace(model, external=External(("./run",), tmp_path, tmp_path / "x.ini"))
    first = parameters_hash(external)
    (tmp_path / "x.ini").write_text("a=2", encoding="utf-8")
    assert parameters_hash(external) not in (first, parameters_hash(model))


def test_parameters_hash_sees_the_program(tmp_path: Path) -> None:
    def model(where: Path, program: str) -> Model:
        (where / "src").mkdir(parents=True, exist_ok=True)
        (where / "src" / "post.py").write_text(program, encoding="utf-8")
        (where / "a.cfg").write_text("a", encoding="utf-8")
        command = ("python3", "src/post.py", "--config=a.cfg", "{ideal}", "../b/a.cfg", "x" * 5000, "\0")
        return Model(Sensor.of("SMART"), external=External(command, where))

    first = model(tmp_path / "a", "a = 1")
    assert first.external is not None
    names = [path.relative_to(tmp_path).as_posix() for path in external_files(first.external)]
    assert names == ["a/a.cfg", "a/src/post.py"]
    before = parameters_hash(first)
    assert parameters_hash(model(tmp_path / "b", "a = 1")) == before
    assert parameters_hash(model(tmp_path / "a", "a = 2")) != before
    gone = dataclasses.replace(first, external=External(("./run",), tmp_path, tmp_path / "gone.ini"))
    with pytest.raises(InputError, match=r"gone\.ini: cannot read this file of the external model"):
        parameters_hash(gone)


def test_the_text_of_a_module_counts(tmp_path):
    (tmp_path / "own").mkdir()
    for name in ("__init__.py", "law.py"):
        (tmp_path / "own" / name).write_text("x = 1\n")
    (tmp_path / "beside.py").write_text("x = 1\n")
    model = Model(Sensor.of("SMART"), external=External((), tmp_path, module="own.law:simulate"))
    seen = [parameters_hash(model)]
    for changed in ("beside.py", "own/law.py"):
        (tmp_path / changed).write_text("x = 2\n")
        seen.append(parameters_hash(model))
    assert seen[0] == seen[1] != seen[2]


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "scenarios").glob("*.toml")))
def test_the_hashes_of_a_shipped_scenario_are_its_goldens(name: str) -> None:
    """The words that hashes are made of stay, however the code is renamed: users' goldens hold such hashes."""
    scenario = load_scenario(ROOT / f"scenarios/{name}.toml")
    made = load_golden(ROOT / f"goldens/{name}.toml").provenance
    assert parameters_hash(scenario.model) == made.parameters
    assert scenario.content_hash == made.scenario


def test_the_hash_of_what_no_model_file_holds_stays() -> None:
    sensor = dataclasses.replace(Sensor.of("SLIM"), nonideal=NonIdeal(crosstalk_sides=0.125, dead_spread_ns=0.5))
    assert parameters_hash(Model(sensor)) == "8a91431dceeb5c03d86a13eeb558692dc52c2bbd7718dced8b2a81c504147c69"


OTHER_SENSOR = dataclasses.replace(
    Sensor.of("SLIM"),
    nonideal=NonIdeal(crosstalk_sides=0.125),
    beams=shipped("XT32").beams,
    sweep=shipped("XT32").sweep,
    features=shipped("XT32").features,
    keep="first",
    strength="PEAK",
    return_order="as_kept",
    duplicate_return="repeat",
    handedness="left",
    time_unit="ms",
    time_zero="last",
    deskewed=True,
    footprint_deg=(0.1, 0.1),
    footprint="box",
    sub_rays=(2, 2),
    min_separation_m=0.5,
)


def _changed(value: object, to: object) -> object:
    """Another value of the same kind; that of `to` where it is a word."""
    return value + 1 if isinstance(value, int) else value * 0.5 + 0.25 if isinstance(value, float) else to


@pytest.mark.parametrize(
    ("part", "other", "left_out"),
    [
        (
            Model(SENSOR),
            Model(Sensor.of("SLIM"), {1: Material("", 0.5)}, (make("fog", {}),), TOOL, Path("b")),
            {"file"},
        ),
        (
            SENSOR,
            OTHER_SENSOR,
            {"name", "source", "tables", "missing", "file", "plain"},
        ),
        (NonIdeal(), NonIdeal(), set()),
        (Material("wall", 0.3), Material("road", 0.3, "retro"), set()),
        (Curve((0.0,), (1.0,), "a.ini"), Curve((1.0,), (2.0,), "b.ini"), {"file"}),
    ],
)
def test_every_field_of_what_is_hashed_has_a_word(part: Any, other: Any, left_out: set[str]) -> None:
    before = hashed_parts(part)
    for field in dataclasses.fields(part):
        value = _changed(getattr(part, field.name), getattr(other, field.name))
        after = hashed_parts(dataclasses.replace(part, **{field.name: value}))
        assert (after == before) == (field.name in left_out), field.name


def test_effects_have_words_of_their_own() -> None:
    effects = [*catalogue().values(), *empirical_terms().values()]
    words = {effect.name: (hashed_parts(effect()) or {})[""] for effect in effects}
    assert len(set(words.values())) == len(words)
    assert words["beam_divergence"] == "BeamDivergence"
    assert words["pulse_shape"] == "BroadPulse"


def test_the_name_of_a_class_is_no_part_of_a_hash() -> None:
    class Mist(find("fog")):  # type: ignore[misc]
        pass

    models = [Model(SENSOR, effects=(effect,)) for effect in (make("fog", {}), Mist())]
    assert parameters_hash(models[0]) == parameters_hash(models[1])


def test_a_part_without_words_is_refused() -> None:
    unknown: Any = PROVENANCE
    with pytest.raises(TypeError, match="Provenance is no parameter that can be hashed"):
        parameters_hash(Model(unknown))


def test_a_golden_that_is_empty_or_the_releases_says_so(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text("\n", encoding="utf-8")
    with pytest.raises(GoldenError, match=r"is empty; .*--accept all"):
        load_golden(tmp_path / "x.toml")
    with pytest.raises(GoldenError, match=r"is empty; .*`lidarcheck review --release`"):
        load_golden(tmp_path / "x.toml", release=True)


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_uncommitted_names_the_scenario(tmp_path: Path) -> None:
    project = Project(tmp_path)
    scenario = project.load(project.file("one"))
    assert str(tmp_path) in uncommitted(scenario)[1]

    def git(*arguments: str) -> None:
        author = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
        subprocess.run(["git", "-C", str(tmp_path), *author, *arguments], check=True, capture_output=True)

    git("init")
    assert "one.toml" in uncommitted(scenario)[0]
    git("add", ".")
    git("commit", "-m", "a")
    assert "one.toml" not in uncommitted(scenario)[0]
    project.file("one").write_text("# changed\n", encoding="utf-8")
    assert "one.toml" in uncommitted(scenario)[0]
    assert "two.toml" not in uncommitted(scenario)[0]
    (tmp_path / "post.py").write_text("a = 1\n", encoding="utf-8")
    scenario.model = dataclasses.replace(scenario.model, external=External(("python3", "post.py"), tmp_path))
    assert "post.py" in uncommitted(scenario)[0]
