"""A small bench with measured vehicles and scenes: frames of the independent generator, ideal and simulated scans."""

import shutil
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from hidden.rays import Beams
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.model import save_model, simulate
from scene_kit import hits_of, ideal_of, measured, model_of, scene_of, vehicle_scene

NEAR_M = (10, 16, 22, 28)
VEHICLE_BEAMS = Beams.block(range(190, 290, 4), range(430, 530, 4))
SCENE_BEAMS = Beams.block(range(216, 296, 2), range(440, 520, 2))


@cache
def _made() -> Path:
    """All files, made once."""
    where = Path(mkdtemp(prefix="lidarcheck-bench-"))
    model = model_of("SMART")
    for name in ("models", "scenes", "slim"):
        (where / name).mkdir()
    save_model(model, where / "models/SMART.toml")
    save_model(model_of("SLIM"), where / "models/SLIM.toml")
    for near_m in NEAR_M:
        scene = vehicle_scene(float(near_m))
        ideal = ideal_of(hits_of(scene, VEHICLE_BEAMS), VEHICLE_BEAMS)
        save_scan(measured(scene, near_m, beams=VEHICLE_BEAMS), where / f"car_{near_m}m_SMART_real.pcd")
        save_scan(simulate(ideal, model, seed=near_m), where / f"car_{near_m}m_SMART_sim.pcd")
        save_ideal(ideal, where / f"ideal_car_{near_m}m.parquet")
    scene = vehicle_scene(14.0, (5.2, 2.0, 2.2))
    save_scan(measured(scene, 7, "SLIM", beams=VEHICLE_BEAMS), where / "slim/van_14m_real.pcd")
    save_ideal(ideal_of(hits_of(scene, VEHICLE_BEAMS), VEHICLE_BEAMS), where / "slim/van_14m_ideal.parquet")
    street = scene_of("street", 51)
    scan = measured(street, 3, beams=SCENE_BEAMS)
    save_scan(scan.take(scan.layer != 240), where / "scenes/real_street.pcd")
    save_ideal(ideal_of(hits_of(street, SCENE_BEAMS), SCENE_BEAMS), where / "scenes/ideal_street.parquet")
    return where


def make_bench(root: Path) -> Path:
    """The files in a new project, and such as are of no use."""
    shutil.copytree(_made(), root)
    (root / "car_50m_SMART_real.txt").write_text("X Y Z Layer Point PEAK AREA WIDTH\n1 2 x 4 5 6 7 8\n")
    shutil.copy(root / "car_16m_SMART_sim.pcd", root / "car_50m_SMART_sim.pcd")
    shutil.copy(root / "car_16m_SMART_real.pcd", root / "truck_16m_SMART_real.pcd")
    (root / "empty.txt").write_text("")
    return root
