"""Scenario files as tests write them: a surface before some beams, a panel or a mesh in a
scene, and the KPIs that are asked."""

__all__ = ["PANEL_MODEL", "TRIANGLE_PLY", "kpis", "panel_scene", "surface", "wall_scenario"]

PANEL_MODEL = 'variant = "SMART"\n[materials.1]\nname = "panel"\nreflectance = 0.8\n'

TRIANGLE_PLY = """\
ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 -5 -5
0 5 -5
0 0 5
3 0 1 2
"""

Pair = tuple[float, float]


def surface(layers: Pair, points: Pair, range_m: Pair) -> str:
    """A `[[beams]]` table of a surface that is perpendicular to each beam."""
    return f"""\
[[beams]]
shape = "surface"
layers = {list(layers)}
points = {list(points)}
material = 1
range_m = {list(range_m)}
"""


def kpis(**tolerances: float) -> str:
    """A `[[kpis]]` table for each kind with its tolerance."""
    return "".join(f'\n[[kpis]]\nkpi = "{kind}"\ntolerance = {value}\n' for kind, value in tolerances.items())


def wall_scenario(layers: Pair, points: Pair, range_m: float = 30.0, model: str = "models/SMART.toml") -> str:
    """A scenario of a wall, without KPIs yet."""
    return f'description = "a wall"\nmodel = "{model}"\n\n' + surface(layers, points, (range_m, range_m))


def panel_scene(layers: Pair, points: Pair) -> str:
    """The scene of a scenario: a panel of 1 m by 1 m at 25 m."""
    return f"""
[[scene.objects]]
shape = "panel"
position_m = [25.0, 0.0, 0.0]
width_m = 1.0
height_m = 1.0
material = 1

[sampling]
layers = {list(layers)}
points = {list(points)}
"""
