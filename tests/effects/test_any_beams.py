"""Effects of sensors whose beams are no built-in grid: a turning head, a rosette, zones."""

from dataclasses import replace

import numpy as np
import pytest

from beams_kit import Room, flash, head, in_room, room, rosette, zones
from effect_kit import MATERIALS, Around, plain
from lidarcheck.effects import catalogue, make
from lidarcheck.effects.geometry.own_rays import rays_of
from lidarcheck.effects.geometry.surfaces import LocalSurfaces
from lidarcheck.effects.shared.blooming import Direction
from lidarcheck.effects.shared.reflectance import REFLECTANCE, with_reflectance
from lidarcheck.errors import UsageError
from lidarcheck.model import Model
from lidarcheck.model.stages import aimed, run_and_light
from lidarcheck.rays import Rays
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Beams, Sensor

ZERO = {
    "beam_divergence": {"vertical_deg": 0.0, "horizontal_deg": 0.0},
    "boresight": {"yaw_deg": 0.0, "pitch_deg": 0.0},
    "motion": {"forward_m_s": 0.0},
    "vibration": {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.0},
    "ambient_light": {"rate_per_ns": 0.0},
    "blockage": {"transmission": 1.0, "first_layer": 0, "last_layer": 1, "first_point": 0, "last_point": 1},
    "blooming_horizontal": {"strength": 0.0},
    "blooming_vertical": {"strength": 0.0},
    "dark_counts": {"rate_per_ns": 0.0},
    "fog": {"mor_m": 1e6},
    "incidence_falloff": {"exponent": 1.0},
    "interference": {"share": 0.0},
    "layer_gain": {"gain": 1.0, "first_layer": 0, "last_layer": 2},
    "material_reflectance": {"factor": 1.0},
    "mirror_multipath": {"reflectivity": 0.0, "grazing": 0.0},
    "pulse_shape": {"stretch": 1.0, "tail_share": 0.0},
    "rain": {"rate_mm_h": 0.0},
    "retro_ghost": {"strength": 0.0},
    "signal_gain": {"gain": 1.0},
    "afterpulsing": {"probability": 0.0},
    "crosstalk": {"sides": 0.0, "corners": 0.0},
    "dead_time": {"shift_ns": 0.0, "spread_ns": 0.0, "recovery_ns": 0.0},
    "threshold": {"shift": 0.0},
    "dropout": {"share": 0.0},
    "range_offset": {"offset_m": 0.0},
    "range_scale": {"fraction": 0.0},
    "timing_jitter": {"sigma_ns": 0.0, "uniform_ns": 0.0},
    "walk_error": {"per_decade_m": 0.0, "bend_m": 0.0},
}
LINEAR_OUT = {"dark_counts", "crosstalk", "afterpulsing", "dead_time", "blooming_vertical", "beam_divergence"}
ZONES_OUT = {"crosstalk", "afterpulsing", "vibration", "motion", "rain", "dropout"}


def yawed(direction: np.ndarray, deg: float) -> np.ndarray:
    """Directions turned to the left."""
    cosine, sine = np.cos(np.deg2rad(deg)), np.sin(np.deg2rad(deg))
    return direction @ np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]).T


@pytest.mark.parametrize("sensor", [Sensor.of("SMART"), head(), head("spad_array"), zones()], ids=lambda s: s.detector)
def test_the_sensors_for_which_an_effect_means_something_are_those_of_the_table(sensor: Sensor) -> None:
    out = {name for name, effect in catalogue().items() if effect.why_not(sensor)}
    assert out == {"spad_array": set(), "linear": LINEAR_OUT, "photon_histogram": ZONES_OUT}[sensor.detector]
    assert set(catalogue()) == set(ZERO)


def test_conditions_of_a_sensor_decide_as_well() -> None:
    def out(sensor: Sensor) -> set[str]:
        return {name for name, effect in catalogue().items() if effect.why_not(sensor)}

    shared = {"sweep": {"direction": "right", "common_receiver": True}}
    wide = {"footprint_deg": {"horizontal": 0.2, "vertical": 0.1}}
    assert LINEAR_OUT - out(head(**shared)) == {"blooming_vertical"}
    assert LINEAR_OUT - out(head(beams=wide)) == {"beam_divergence"}
    assert out(head(returns=1)) - LINEAR_OUT == {"retro_ghost"}
    assert out(head(returns=1, keep="last")) == LINEAR_OUT
    assert out(head(returns=1, linear={"edge_factor": 0.0})) - LINEAR_OUT == {"retro_ghost", "pulse_shape"}
    assert out(head(deskewed=True)) - LINEAR_OUT == {"motion", "vibration", "boresight"}
    assert out(flash()) - LINEAR_OUT == {"motion"}
    assert out(zones(photon_histogram={"readout": "first"})) - ZONES_OUT == {"dead_time"}


def test_an_effect_that_means_nothing_is_refused_in_one_line() -> None:
    model = Model(head(), MATERIALS, (make("dark_counts", {}),))
    with pytest.raises(UsageError, match="dark_counts means nothing for test: its dark noise is one number"):
        run_and_light(in_room(head().beams), model, 1, 0, None)


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("layer_gain", {"first_layer": 3, "last_layer": 16}, "last_layer = 16 lies beyond .* 0 to 15"),
        ("blockage", {"first_layer": 0, "last_layer": 15, "last_point": 900}, "last_point = 900 .* 0 to 899"),
    ],
)
def test_layers_and_points_beyond_the_sensor_are_refused_with_its_range(
    name: str, settings: dict[str, int], words: str
) -> None:
    with pytest.raises(UsageError, match=words) as caught:
        make(name, settings).check(head())
    assert "\n" not in str(caught.value)
    make(name, settings).check(Sensor.of("SLIM"))


@pytest.mark.parametrize(
    "sensor", [head(), head("spad_array"), flash(), zones()], ids=["head", "spads", "flash", "zones"]
)
def test_no_strength_is_no_effect_on_any_sensor(sensor: Sensor) -> None:
    ideal = in_room(sensor.beams)
    around = Around(ideal, sensor, scene=Room())
    light, scan = plain(around), Scan.from_beams(ideal.layer, ideal.point, ideal.distance_m, beams=sensor.beams)
    tables = {"aim": ideal, "light": light, "readout": scan}
    for name, settings in ZERO.items():
        effect = make(name, settings)
        if effect.why_not(sensor):
            continue
        if effect.stage == "detector":
            assert effect.detector(sensor) is sensor  # type: ignore[attr-defined]
        else:
            assert getattr(effect, effect.stage)(tables[effect.stage], around) is tables[effect.stage], name
        if effect.stage == "readout":
            assert effect.before(light, sensor) == (light, sensor)  # type: ignore[attr-defined]


@pytest.mark.parametrize("beams", [head().beams, rosette(), flash().beams], ids=["head", "rosette", "flash"])
def test_flat_surfaces_are_met_exactly_by_turned_and_moved_rays(beams: Beams) -> None:
    ideal = in_room(beams)
    own = rays_of(ideal)
    surfaces = LocalSurfaces.of(ideal)
    assert np.array_equal(surfaces.cast(own).distance_m, ideal.distance_m)
    for origin, direction in (
        (own.origin_m, yawed(own.direction, 0.4)),
        (own.origin_m + np.array([0.5, 0.2, 0.1]), own.direction),
    ):
        met = surfaces.cast(Rays(origin, direction, own.time_s, own.slot)).distance_m
        truth = room(origin, direction)[0]
        assert np.mean(np.abs(met - truth) < 1e-6) > 0.93  # the rest lies where two walls meet


def test_a_turned_head_meets_what_its_directions_and_origins_meet() -> None:
    sensor = head()
    ideal = in_room(sensor.beams)
    turn = make("boresight", {"yaw_deg": 5.0, "pitch_deg": 0.0})
    around = Around(ideal, sensor, scene=Room())
    turned = turn.aim(ideal, around)  # type: ignore[attr-defined]
    origin, direction = (
        sensor.beams.origins_m(ideal.layer, ideal.point),
        sensor.beams.directions(ideal.layer, ideal.point),
    )
    assert origin is not None
    assert turned.distance_m == pytest.approx(room(yawed(origin, 5.0), yawed(direction, 5.0))[0], abs=1e-9)
    back = make("boresight", {"yaw_deg": -5.0, "pitch_deg": 0.0}).aim(turned, around)  # type: ignore[attr-defined]
    assert back.distance_m == pytest.approx(ideal.distance_m, abs=1e-3)  # origins turn by sums


def test_a_driving_head_shortens_ranges_by_its_way_until_each_beam_is_fired() -> None:
    sensor = head()
    layer, point = np.arange(16), np.full(16, 450)  # a column that looks back
    point[8:] = 0  # and one that looks ahead
    ideal = in_room(sensor.beams, layer, point)
    drive = make("motion", {"forward_m_s": 10.0})
    moved = drive.aim(ideal, Around(ideal, sensor, scene=Room()))  # type: ignore[attr-defined]
    fired_s = point * 0.1 / 900 + 2e-6 * layer
    ahead = ideal.object_id == 0
    along = np.abs(sensor.beams.directions(layer, point)[:, 0])
    assert ahead.sum() == 3
    assert (moved.distance_m - ideal.distance_m)[ahead] == pytest.approx((-10.0 * fired_s / along)[ahead], rel=1e-6)
    behind = ideal.object_id == 1
    assert (moved.distance_m - ideal.distance_m)[behind] == pytest.approx((10.0 * fired_s / along)[behind], rel=1e-6)


def test_a_swing_turns_each_beam_by_its_own_moment_and_chance_by_column() -> None:
    sensor = head()
    ideal = in_room(sensor.beams)
    around = Around(ideal, sensor)
    swing = make("vibration", {"pitch_deg": 0.3, "yaw_deg": 0.0, "frequency_hz": 40.0, "random_deg": 0.0})
    yaw, pitch = swing.angles_deg(ideal.layer, ideal.point, around)  # type: ignore[attr-defined]
    fired_s = ideal.point * 0.1 / 900 + 2e-6 * ideal.layer
    assert not yaw.any()
    assert pitch == pytest.approx(0.3 * np.sin(2 * np.pi * 40.0 * fired_s), abs=1e-12)
    tremble = make("vibration", {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.1})
    pitch = tremble.angles_deg(ideal.layer, ideal.point, around)[1].reshape(16, 900)  # type: ignore[attr-defined]
    assert np.ptp(pitch, axis=0).max() == 0.0
    assert pitch[0].std() == pytest.approx(0.1, rel=0.1)
    still = in_room(flash().beams)
    once = tremble.angles_deg(still.layer, still.point, Around(still, flash()))[1]  # type: ignore[attr-defined]
    assert np.ptp(once) == 0.0 != once[0]


def test_dirt_covers_what_looks_through_it_whatever_the_numbers() -> None:
    sensor = head("spad_array")
    ideal = in_room(sensor.beams)
    around = Around(ideal, sensor)
    # Channels 2 to 5 are those from 11 to 5 deg; columns 890 to 899 look 4 to 0.4 deg to the left.
    patch = {"first_layer": 2, "last_layer": 5, "first_point": 890, "last_point": 899, "soft_edge_deg": 0.0}
    dirty = make("blockage", {"transmission": 0.25, **patch}).light(plain(around), around)  # type: ignore[attr-defined]
    elevation, azimuth = sensor.beams.angles_deg(dirty.layer, dirty.point)
    inside = (np.abs(elevation - 8.0) < 4.0) & (azimuth > 0.2) & (azimuth < 4.2)
    assert inside.sum() == 40
    assert dirty.pulse_signal / plain(around).pulse_signal == pytest.approx(np.where(inside, 0.25, 1.0))


@pytest.mark.parametrize("roundness", [0.0, 1.0])
def test_dirt_on_numbers_that_no_beam_of_a_scan_has_dims_nothing(roundness) -> None:
    ideal = in_room(rosette(50, of_scan=True))
    around = Around(ideal)
    patch = {"first_layer": 3, "last_layer": 4, "first_point": 1, "last_point": 2, "roundness": roundness}
    dirty = make("blockage", {"transmission": 0.25, **patch}).light(plain(around), around)  # type: ignore[attr-defined]
    assert dirty.pulse_signal.tolist() == plain(around).pulse_signal.tolist()


def test_dirt_on_a_chip_brightens_its_cover_glass() -> None:
    sensor = zones()
    ideal = in_room(sensor.beams)
    around = Around(ideal, sensor)
    patch = {"first_layer": 1, "last_layer": 1, "first_point": 1, "last_point": 1, "soft_edge_deg": 0.0}
    dirty = make("blockage", {"transmission": 0.25, **patch}).light(plain(around), around)  # type: ignore[attr-defined]
    glare = dirty.pulse_range_m == 0.0
    assert dirty.pulse_beam[glare].tolist() == [4]
    assert dirty.pulse_signal[glare] == pytest.approx([0.75 * 4e-4])


def test_bloom_goes_up_the_image_column_and_along_the_layer_in_beams() -> None:
    shift = {"column_shift": [i % 3 for i in range(16)]}
    sensor = head(sweep={"direction": "right", "common_receiver": True}, beams=shift)
    layer, point = sensor.beams.every()
    target = (layer == 8) & (point == 1)
    material = np.where(target, 3, 0)
    ideal = IdealScan(layer, point, np.full(len(layer), 30.0), material, np.zeros(len(layer)), beams=sensor.beams)
    around = Around(ideal, sensor)
    source = float(around.signal(ideal)[target][0])
    tall = {"core_up": 0.02, "core_down": 0.01, "core_rows": 2.0, "skirt_up": 0.0, "skirt_down": 0.0, "reach_rows": 5.0}
    light = make("blooming_vertical", tall).light(plain(around), around)  # type: ignore[attr-defined]
    new = (light.rows() >= 0) & (light.pulse_signal > 0.0) & (light.layer[light.pulse_beam] != 8)
    beam, column = light.pulse_beam[new], (1 + 8 % 3) % 900
    assert light.layer[beam].tolist() == [3, 4, 5, 6, 7, 9, 10, 11, 12, 13]
    assert ((light.point[beam] + light.layer[beam] % 3) % 900 == column).all()
    up = 8 - light.layer[beam]  # the uppermost channel is the first
    core = np.where(up > 0, 0.02, 0.01) * np.exp(-np.abs(up) / 2.0)
    assert light.pulse_signal[new] == pytest.approx(source * core)
    wide = {"core_left": 0.02, "core_right": 0.01, "core_columns": 2.0, "skirt_left": 0.0, "skirt_right": 0.0}
    light = make("blooming_horizontal", {**wide, "reach_columns": 3.0}).light(plain(around), around)  # type: ignore[attr-defined]
    new = (light.pulse_signal > 0.0) & (light.point[light.pulse_beam] != 1)
    beam = light.pulse_beam[new]
    assert light.layer[beam].tolist() == [8] * 6
    assert light.point[beam].tolist() == [0, 2, 3, 4, 898, 899]  # the layer goes once around, to the right
    left = np.array([1, -1, -2, -3, 3, 2])
    assert light.pulse_signal[new] == pytest.approx(source * np.where(left > 0, 0.02, 0.01) * np.exp(-np.abs(left) / 2))


def test_offsets_of_a_spad_array_count_rows_and_columns_of_a_twentieth_of_a_degree() -> None:
    slim = Sensor.of("SLIM")
    assert [Direction.of(slim, slim.beams, vertical=v).step for v in (True, False)] == [3.0, 2.5]
    assert [Direction.of(head(), head().beams, vertical=v).step for v in (True, False)] == [1.0, 1.0]


def test_sunlight_is_noise_of_a_linear_detector_by_what_it_meets() -> None:
    sensor = head()
    layer = np.arange(3)
    ideal = IdealScan(layer, np.zeros(3, int), [10.0, 10.0, 0.0], [1, 2, 1], np.zeros(3), beams=sensor.beams)
    sun = make("ambient_light", {"rate_per_ns": 2.0, "sky": 0.3})
    around = Around(ideal, sensor)
    assert sun.light(plain(around), around).background_per_ns == pytest.approx([0.8, 2.0, 0.6])  # type: ignore[attr-defined]
    own = with_reflectance(ideal, np.array([0.5, np.nan, np.nan]))
    around = Around(own, sensor)
    assert sun.light(plain(around), around).background_per_ns == pytest.approx([1.0, 2.0, 0.6])  # type: ignore[attr-defined]


def test_foreign_light_raises_a_chips_floor_unless_both_fire_in_step() -> None:
    sensor = zones()
    ideal = in_room(sensor.beams)
    around = Around(ideal, sensor)
    foreign = {"share": 0.5, "signal": 1e-3, "spread_decades": 0.0, "farthest_m": 150.0}
    floor = make("interference", foreign).light(plain(around), around)  # type: ignore[attr-defined]
    window_ns = 2.0 * 150.0 / 0.299792458
    assert floor.background_per_ns == pytest.approx(0.5 * 1e-3 / window_ns)
    assert len(floor.pulse_signal) == len(ideal)
    step = make("interference", {**foreign, "share": 2.0, "column_span_m": 1.0})
    peaks = step.light(plain(around), around)  # type: ignore[attr-defined]
    assert len(peaks.pulse_signal) > len(ideal)
    assert not peaks.background_per_ns.any()


def test_thresholds_of_each_detector() -> None:
    up = make("threshold", {"shift": 1.5})
    assert up.detector(head()).threshold == pytest.approx(7.34)  # type: ignore[attr-defined]
    assert up.detector(zones()).threshold_sigma == pytest.approx(6.5)  # type: ignore[attr-defined]
    given = head(linear={"false_rate_hz": 1000.0, "noise": 2.0})
    higher = up.detector(given)  # type: ignore[attr-defined]
    assert higher.false_rate_hz == pytest.approx(1000.0 * np.exp(-(7.34**2 - 5.84**2) / (2.0 * 2.0**2)))
    assert higher.walk_reference == pytest.approx(58.4)


def test_the_dead_time_of_a_histogram_is_its_mean() -> None:
    sensor = zones(photon_histogram={"dead_bins": 20})
    longer = make("dead_time", {"shift_ns": 2.0, "spread_ns": 1.0, "recovery_ns": 1.0})
    assert longer.detector(sensor).dead_bins == 26  # type: ignore[attr-defined]
    with pytest.raises(UsageError, match=r"shift_ns = -20.0 .*a bin of 0.5 ns"):
        make("dead_time", {"shift_ns": -20.0}).detector(sensor)  # type: ignore[attr-defined]


def test_jitter_and_ranges_of_a_histogram_change_its_light_not_its_echoes() -> None:
    sensor = zones()
    ideal = in_room(sensor.beams)
    around = Around(ideal, sensor)
    light = plain(around)
    scan = Scan.from_beams(ideal.layer, ideal.point, ideal.distance_m, beams=sensor.beams)
    jitter = make("timing_jitter", {"sigma_ns": 0.6, "uniform_ns": 0.3})
    same, wider = jitter.before(light, sensor)  # type: ignore[attr-defined]
    variance = (sensor.pulse_fwhm_ns / 2.3548) ** 2 + 0.6**2 + 0.3**2 / 3.0
    assert wider.pulse_fwhm_ns == pytest.approx(2.3548 * np.sqrt(variance))
    assert same.shape is None
    shaped = make("pulse_shape", {"stretch": 2.0}).light(light, around)  # type: ignore[attr-defined]
    shaped = jitter.before(shaped, sensor)[0]  # type: ignore[attr-defined]
    assert shaped.shape.fwhm_ns == pytest.approx(np.sqrt(4.0 + 2.3548**2 * 0.39))
    for name, settings, moved in (
        ("range_offset", {"offset_m": 0.5}, light.pulse_range_m + 0.5),
        ("range_scale", {"fraction": 0.02}, 1.02 * light.pulse_range_m),
    ):
        effect = make(name, settings)
        assert effect.before(light, sensor)[0].pulse_range_m == pytest.approx(moved)  # type: ignore[attr-defined]
        assert effect.readout(scan, around) is scan  # type: ignore[attr-defined]
    assert jitter.readout(scan, around) is scan  # type: ignore[attr-defined]


def test_a_counted_pulse_is_blurred_and_keeps_its_light_and_centre() -> None:
    sensor = replace(zones(), pulse=(0.0, 3.0, 5.0, 2.0))  # type: ignore[call-arg]
    around = Around(in_room(sensor.beams), sensor)
    pulse = np.array(make("timing_jitter", {"sigma_ns": 1.0}).before(plain(around), sensor)[1].pulse)  # type: ignore[attr-defined]
    bins, before = np.arange(len(pulse)), np.array(sensor.pulse)  # type: ignore[attr-defined]
    middle, old = np.average(bins, weights=pulse), np.average(np.arange(4), weights=before)
    assert pulse.sum() == pytest.approx(before.sum())
    spread = np.average((bins - middle) ** 2, weights=pulse) - np.average((np.arange(4) - old) ** 2, weights=before)
    assert spread == pytest.approx((1.0 / 0.5) ** 2, rel=0.03)


def test_walk_goes_by_the_detectors_own_amplitude() -> None:
    sensor = head()
    layer = np.arange(4)
    strength = np.array([10.0, 100.0, 1000.0, 1e4])
    scan = Scan.from_beams(layer, np.zeros(4, int), np.full(4, 20.0), beams=sensor.beams)
    scan = replace(scan, made={"amplitude": strength})
    walk = make("walk_error", {"per_decade_m": 0.1, "reference_area": 100.0})
    moved = walk.readout(scan, Around(in_room(sensor.beams), sensor))  # type: ignore[attr-defined]
    assert moved.range_m == pytest.approx([19.9, 20.0, 20.1, 20.2])
    assert np.array_equal(moved.strength, strength)


def test_gains_of_zones_and_of_channels() -> None:
    sensor = zones()
    around = Around(in_room(sensor.beams), sensor)
    gain = make("layer_gain", {"gain": 0.5, "first_layer": 3, "last_layer": 4})
    ratio = gain.light(plain(around), around).pulse_signal / plain(around).pulse_signal  # type: ignore[attr-defined]
    assert ratio == pytest.approx([1, 1, 1, 0.5, 0.5, 1, 1, 1, 1])
    gain.check(sensor)
    with pytest.raises(UsageError, match=r"last_layer = 9 .* 0 to 8"):
        make("layer_gain", {"first_layer": 3, "last_layer": 9}).check(sensor)
    sensor = head("spad_array")
    around = Around(in_room(sensor.beams), sensor)
    ratio = gain.light(plain(around), around).pulse_signal / plain(around).pulse_signal  # type: ignore[attr-defined]
    assert ratio.reshape(16, 900)[:, 0] == pytest.approx(np.where((np.arange(16) == 3) | (np.arange(16) == 4), 0.5, 1))


def test_a_zone_that_is_wider_sees_farther_aside() -> None:
    sensor = zones()
    layer, point = np.repeat(sensor.beams.every(), 9, axis=1)
    up, aside = np.tile(np.repeat([-1, 0, 1], 3), 9) * 10.0 / 3.0, np.tile([-1, 0, 1], 27) * 10.0 / 3.0
    elevation, azimuth = (a + b for a, b in zip(sensor.beams.angles_deg(layer, point), (up, aside), strict=True))

    def unit(elevation: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
        e, a = np.deg2rad(elevation), np.deg2rad(azimuth)
        return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)

    zero = np.zeros((len(layer), 3))
    distance, incidence, wall = room(zero, unit(elevation, azimuth))
    xyz = distance[:, None] * unit(elevation, azimuth)
    ideal = IdealScan(
        layer, point, distance, np.ones(len(layer), int), incidence, wall,
        extra={"X": xyz[:, 0], "Y": xyz[:, 1], "Z": xyz[:, 2]}, beams=sensor.beams,
    )  # fmt: skip
    wide = make("beam_divergence", {"vertical_deg": 0.0, "horizontal_deg": 3.0})
    wider = wide.aim(ideal, Around(ideal, sensor, scene=Room()))  # type: ignore[attr-defined]
    truth = room(zero, unit(elevation, azimuth + 0.3 * aside))[0]
    assert wider.distance_m == pytest.approx(truth, rel=1e-9)
    alone = wide.aim(ideal, Around(ideal, sensor))  # type: ignore[attr-defined]
    assert np.mean(np.abs(alone.distance_m - truth) < 0.1 * truth) > 0.9
    with pytest.raises(UsageError, match="does not say where the rays of its zones point"):
        wide.aim(in_room(sensor.beams), Around(ideal, sensor))  # type: ignore[attr-defined]


@pytest.mark.parametrize("beams", [head().beams, flash().beams, rosette()], ids=["head", "flash", "rosette"])
def test_patches_of_fog_go_by_azimuth_and_layers_of_it_by_height(beams: object) -> None:
    sensor = replace(head(), beams=beams)  # type: ignore[arg-type]
    layer, point = sensor.beams.every()
    ideal = IdealScan(
        layer, point, np.full(len(layer), 40.0), np.ones(len(layer), int), np.zeros(len(layer)), beams=beams
    )  # type: ignore[arg-type]
    around = Around(ideal, sensor)
    plain_light = plain(around)
    fog = {"mor_m": 100.0, "backscatter": 0.0}
    thin = make("fog", {**fog, "thinning_per_m": 0.2}).light(plain_light, around)  # type: ignore[attr-defined]
    sine = np.sin(np.deg2rad(sensor.beams.angles_deg(layer, point)[0]))
    x = 0.2 * 40.0 * sine
    depth_m = 40.0 * np.where(np.abs(x) < 1e-9, 1.0, -np.expm1(-x) / np.where(np.abs(x) < 1e-9, 1.0, x))
    seen = thin.pulse_signal / plain_light.pulse_signal
    assert -np.log(seen) == pytest.approx(2.0 * np.log(20.0) / 100.0 * depth_m, rel=0.01)
    patchy = make("fog", {**fog, "patchiness": 0.5, "patch_deg": 10.0}).light(plain_light, around)  # type: ignore[attr-defined]
    toll = -np.log(patchy.pulse_signal / plain_light.pulse_signal)
    azimuth = sensor.beams.angles_deg(layer, point)[1]
    order = np.argsort(azimuth, kind="stable")
    near = np.diff(azimuth[order]) < 0.01
    assert np.median(np.abs(np.diff(toll[order])[near])) < 0.02 * toll.std()
    assert toll.std() > 0.03 * toll.mean()


def test_reflectance_of_rows_stands_in_for_that_of_materials() -> None:
    sensor = head()
    layer = np.arange(4)
    rows = IdealScan(
        layer, np.zeros(4, int), [10.0, 10.0, 10.0, 0.0], [1, 1, 3, 1], [60.0, 60.0, 60.0, 0.0], beams=sensor.beams
    )
    around = Around(with_reflectance(rows, np.array([0.8, np.nan, 0.25, 0.5])), sensor)
    found, table = around.signal(around.ideal), around.signal(rows)
    assert found == pytest.approx([461000.0 * 0.8 * 0.5 / 100.0, table[1], 461000.0 * 0.25 * 1000.0 / 100.0, 0.0])


def test_a_turned_view_takes_the_reflectance_along() -> None:
    sensor = replace(head("spad_array"), max_range_m=100.0)
    point = sensor.beams.every()[1]
    ideal = with_reflectance(in_room(sensor.beams), np.where(point < 450, 0.2, 0.6))
    model = Model(sensor, MATERIALS, (make("boresight", {"yaw_deg": -8.0, "pitch_deg": 0.0}),))
    turned = aimed(ideal, model)
    assert REFLECTANCE in turned.extra
    expected = np.where(np.mod(point + 20, 900) < 450, 0.2, 0.6)  # 20 columns of 0.4 deg, to the right
    assert np.mean(turned.extra[REFLECTANCE] == expected) > 0.98


@pytest.mark.parametrize(
    "beams", [head().beams, rosette(), rosette(of_scan=True)], ids=["head", "rosette", "a scan's own"]
)
def test_an_object_that_moves_is_met_where_it_is_and_uncovers_what_lies_beside_it(beams: Beams) -> None:
    """A board 8 m ahead of a wall at 20 m that moves to the left by 1 m."""
    layer, point = beams.every()
    ahead = beams.directions(layer, point)[:, 0] > 0.9
    ideal = in_room(beams, layer[ahead], point[ahead])
    rays = rays_of(ideal)

    def with_board(left_m: float) -> tuple[np.ndarray, np.ndarray]:
        distance, _, wall = room(rays.origin_m, rays.direction)
        way = (8.0 - rays.origin_m[:, 0]) / rays.direction[:, 0]
        at = rays.origin_m + way[:, None] * rays.direction
        on = (np.abs(at[:, 1] - left_m) < 1.2) & (np.abs(at[:, 2]) < 1.0)
        return np.where(on, way, distance), np.where(on, 9, wall)

    distance, number = with_board(0.0)
    seen = replace(ideal, distance_m=distance, object_id=number)
    later = replace(rays, time_s=np.full(len(rays), 0.5))
    met = LocalSurfaces.of(seen).cast(later, moving={9: (0.0, 2.0, 0.0)})
    truth, where = with_board(1.0)
    assert (number == 9).sum() > 50
    assert np.mean((met.object_id == 9) == (where == 9)) > 0.97
    board = (met.object_id == 9) & (where == 9)
    assert np.mean(np.abs(met.distance_m - truth)[board] < 1e-5) > 0.99
    uncovered = (number == 9) & (where != 9) & (met.object_id != 9)
    assert uncovered.sum() > 10
    assert np.median(np.abs(met.distance_m - truth)[uncovered]) < 1.0


def test_a_wet_floor_mirrors_the_walls_of_a_head_whose_surroundings_nobody_else_knows() -> None:
    sensor = head("spad_array")
    ideal = in_room(sensor.beams)
    facts = run_and_light(ideal, Model(sensor, MATERIALS), 1, 0, None)[0]
    wet = make("mirror_multipath", {"reflectivity": 0.5, "roughness_deg": 0.0})
    light = wet.light(plain(Around(ideal, sensor)), facts)  # type: ignore[attr-defined]
    new = light.pulse_range_m > ideal.distance_m[light.pulse_beam] + 0.5
    row = light.pulse_beam[new]
    assert new.sum() > 1000
    assert (ideal.object_id[row] == 4).all()  # type: ignore[index]
    origin, direction = rays_of(ideal).origin_m[row], rays_of(ideal).direction[row]
    at = origin + ideal.distance_m[row][:, None] * direction
    onward = room(at + np.array([0.0, 0.0, 1e-6]), direction * [1.0, 1.0, -1.0])[0]
    assert np.mean(np.abs(light.pulse_range_m[new] - ideal.distance_m[row] - onward) < 0.02) > 0.95


def test_a_footprint_is_looked_at_where_surfaces_end_whatever_the_beams() -> None:
    sensor = head("spad_array")
    ideal = in_room(sensor.beams)
    wide = make("beam_divergence", {"vertical_deg": 0.1, "horizontal_deg": 0.2})
    spread = aimed(ideal, Model(sensor, MATERIALS, (wide,)))
    rows = np.bincount(sensor.beams.index(spread.layer, spread.point), minlength=sensor.beams.size)
    split = rows > 1
    corner = np.abs(sensor.beams.angles_deg(*sensor.beams.every())[1]) - np.rad2deg(np.arctan2(12.0, 20.0))
    assert 0.01 < split.mean() < 0.4
    assert split[np.abs(corner) < 0.05].any()
