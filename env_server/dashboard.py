"""Bodies made by name: a car's dashboard and the cross-car beam behind it, with the places where a harness is clipped on.

Both are solids of manifold3d, so they are watertight by construction. The dashboard is a folded sheet 3 mm thick: a profile
in the y-z plane, extruded across the car and cut out for instruments, screen, vents, glove box and clips. It is bent as real
ones are, y += 0.10 m (x / 0.7 m)^2 and z -= 0.02 m (x / 0.7 m)^2, in flat strips of 0.07 m, 0.12 mm off the true curve. Every part is bent
before the parts are joined and cut, with strips that end at the same planes: a long triangle bent afterwards leaves the sheet.

Body frame of the dashboard: x across the car, y into the depth of the car, z up; the lip, the sharp front edge of the top,
passes through the origin along x. Body frame of the beam: the same directions, origin on the tube's axis at mid-length.
Clips count from left to right as seen by who stands in front and looks along y.

Neglected: rounded folds (the lip is sharper than a moulded part's), ribs and foam. No dimension is taken from a real car.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from manifold3d import Manifold

GENERATED: Final = ("dashboard", "beam")
WIDTH: Final = 1.40  # m, across the car
THICKNESS: Final = 0.003  # m, of the dashboard's sheet
BEND: Final = (0.10 / 0.7**2, -0.02 / 0.7**2)  # 1/m, of y and z along x
STRIP: Final = 0.07  # m, width of the flat strips that the bent surface is made of

PROFILE: Final = (  # m, outer side of the sheet in (y, z), from the windscreen over the lip down to the knees
    (0.400, -0.045),
    (0.330, 0.012),
    (0.160, 0.028),
    (0.000, 0.000),  # lip
    (0.030, -0.040),
    (0.055, -0.150),
    (0.015, -0.185),  # foot of the ledge
    (0.020, -0.330),
    (0.085, -0.430),
    (0.160, -0.460),
)
TOP, LEDGE = 2, 5  # segments of the profile that carry clips
CLUSTER: Final = (-0.53, -0.19)  # m, instruments from x to x

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Clip:
    """A hole that a clip of the harness is pressed into, in body coordinates."""

    position: Vector  # m, centre of the hole's rim on the side that the cable comes from
    axis: Vector  # unit, outward: against the direction in which the clip is pressed


@dataclass(frozen=True)
class Generated:
    """A generated body: a closed surface, and its clips by name."""

    vertices: np.ndarray  # (v, 3) m
    triangles: np.ndarray  # (t, 3) int, counter-clockwise from outside
    clips: dict[str, Clip]


def generate(kind: str) -> Generated:
    """Make the body called `kind`, one of `GENERATED`; the same arrays every time.

    Raises:
        KeyError: If there is no such body.
    """
    solid, clips = {"dashboard": _dashboard, "beam": _beam}[kind]()
    mesh = solid.to_mesh64()
    vertices = np.ascontiguousarray(mesh.vert_properties[:, :3], dtype=np.float64)
    triangles = np.ascontiguousarray(mesh.tri_verts, dtype=np.int64)
    for array in (vertices, triangles):
        array.setflags(write=False)
    return Generated(vertices=vertices, triangles=triangles, clips=clips)


def _dashboard() -> tuple[Manifold, dict[str, Clip]]:
    left, right = CLUSTER
    skin = _sheet(PROFILE, THICKNESS) + _end_walls()
    skin -= _block((left, right), (-0.05, 0.08), (-0.125, 0.10))  # lip and face give way to the instruments
    holes = (
        _front_openings()
        + _vents(cut=True)
        + _block((-0.50, -0.05), (0.285, 0.300), (-0.1, 0.1))
        + _block((0.05, 0.50), (0.285, 0.300), (-0.1, 0.1))
    )
    clips: dict[str, Clip] = {}
    for index, x in enumerate((-0.10, 0.04, 0.18, 0.32, 0.46, 0.60)):
        holes += _clip_hole(clips, f"clip_{index + 1}", x, segment=TOP, fraction=0.72, oval=index % 2 == 0)
    for index, x in enumerate((-0.60, -0.12, 0.19, 0.35, 0.51, 0.63)):
        holes += _clip_hole(clips, f"ledge_{index + 1}", x, segment=LEDGE, fraction=0.5, oval=index % 2 == 1)
    solid = (skin - holes) + _instruments() + _vents(cut=False) + _pockets()
    return solid.simplify(3e-5), {name: _bend_clip(clip) for name, clip in clips.items()}


def _sheet(profile: tuple[tuple[float, float], ...], thickness: float) -> Manifold:
    """Sheet whose outer side follows the profile; its inner side lies `thickness` to the left, with mitred folds."""
    outer = np.array(profile)
    along = np.diff(outer, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1)
    before, after = np.vstack([inward[:1], inward]), np.vstack([inward, inward[-1:]])
    inner = outer + thickness * (before + after) / (1.0 + np.einsum("ij,ij->i", before, after))[:, None]
    return _bent_prism(np.vstack([outer, inner[::-1]]), (-WIDTH / 2, WIDTH / 2))


def _end_walls() -> Manifold:
    """Closed ends left and right, so that the dashboard is stiff and looks like one."""
    profile = np.array(PROFILE)
    return _bent_prism(profile, (-WIDTH / 2, -WIDTH / 2 + THICKNESS)) + _bent_prism(profile, (WIDTH / 2 - THICKNESS, WIDTH / 2))


def _front_openings() -> Manifold:
    return (
        _block((-0.055, 0.155), (0.0, 0.12), (-0.135, -0.055))  # screen
        + _block((-0.045, 0.145), (-0.02, 0.12), (-0.315, -0.205))  # heater controls
        + _block((0.23, 0.58), (-0.02, 0.12), (-0.345, -0.210))  # glove box
        + _block((-0.42, -0.30), (-0.02, 0.14), (-0.400, -0.200))  # steering column
    )


def _pockets() -> Manifold:
    """What one sees in the openings: the screen, the heater's panel, the bin of the glove box, each a tray behind the sheet."""
    inside = _bent_prism(np.array(PROFILE), (-WIDTH / 2, WIDTH / 2))
    trays = []
    for (left, right), back, (low, high) in (
        ((-0.055, 0.155), 0.062, (-0.135, -0.055)),
        ((-0.045, 0.145), 0.034, (-0.315, -0.205)),
        ((0.23, 0.58), 0.160, (-0.345, -0.210)),
    ):
        tray = _block((left - 0.003, right + 0.003), (-0.05, back + 0.003), (low - 0.003, high + 0.003))
        trays.append(tray - _block((left, right), (-0.06, back), (low, high)))
    return _union(trays) ^ inside


def _vents(*, cut: bool) -> Manifold:
    """Four air vents in the face: the openings to cut, or the slats that stand in them."""
    parts = []
    for x in (-0.62, -0.12, 0.225, 0.62):
        if cut:
            parts.append(_block((x - 0.045, x + 0.045), (0.0, 0.12), (-0.125, -0.065)))
        else:
            parts += [_block((x - 0.047, x + 0.047), (0.038, 0.058), (z - 0.0015, z + 0.0015)) for z in (-0.11, -0.095, -0.08)]
    return _union(parts)


def _instruments() -> Manifold:
    """The hood over the instruments, the pocket behind it, and two dials."""
    from manifold3d import CrossSection, Manifold

    left, right = CLUSTER
    middle, half = (left + right) / 2, (right - left) / 2
    arch = CrossSection.circle(1.0, 40).scale((half + 0.006, 0.080))
    arch -= CrossSection.circle(1.0, 40).scale((half + 0.001, 0.075))
    arch = arch ^ CrossSection.square((1.0, 0.2)).translate((-0.5, -0.02))
    hood = arch.extrude(0.30, 3, 0.0, (0.86, 0.10)).rotate((90, 0, 0)).mirror((0, 1, 0))  # tapers along y, to the rear
    hood = hood.translate((middle, -0.030, 0.006)).trim_by_plane((0.0, 0.94, 0.34), 0.004)  # rim leans towards the driver
    pocket = _block((left - 0.003, right + 0.003), (0.026, 0.095), (-0.128, 0.030)) - _block((left, right), (0.0, 0.092), (-0.125, 0.2))
    dials = []
    for x in (middle - 0.085, middle + 0.085):
        ring = Manifold.cylinder(0.016, 0.060, circular_segments=32) - Manifold.cylinder(0.016, 0.054, circular_segments=32)
        dials.append((ring + Manifold.cylinder(0.008, 0.007, circular_segments=16)).rotate((90, 0, 0)).translate((x, 0.0925, -0.055)))
    return _union([hood.warp_batch(_bend), pocket, *(dial.warp_batch(_bend) for dial in dials)])


def _clip_hole(clips: dict[str, Clip], name: str, x: float, *, segment: int, fraction: float, oval: bool) -> Manifold:
    """Cutter for a hole in the sheet, square to the profile's segment at a fraction of it; enters the clip under its name."""
    start, end = np.array(PROFILE[segment]), np.array(PROFILE[segment + 1])
    y, z = start + fraction * (end - start)
    along = (end - start) / np.linalg.norm(end - start)
    axis = (0.0, float(along[1]), float(-along[0]))
    clips[name] = Clip(position=(x, float(y), float(z)), axis=axis)
    tilt = math.degrees(math.atan2(-axis[1], axis[2]))
    return _hole(oval=oval).rotate((tilt, 0, 0)).translate((x, float(y), float(z))).warp_batch(_bend)


def _hole(*, oval: bool) -> Manifold:
    """Cutter along z: oval 6.5 by 12.5 mm, long along x, or round with 8 mm diameter."""
    from manifold3d import CrossSection

    if not oval:
        return CrossSection.circle(0.004, 24).extrude(0.02).translate((0, 0, -0.01))
    ends = [CrossSection.circle(0.00325, 20).translate((x, 0.0)) for x in (-0.003, 0.003)]
    return CrossSection.batch_hull(ends).extrude(0.02).translate((0, 0, -0.01))


def _bend(points: np.ndarray) -> np.ndarray:
    square = points[:, 0] ** 2
    return np.stack([points[:, 0], points[:, 1] + BEND[0] * square, points[:, 2] + BEND[1] * square], axis=1)


def _bend_clip(clip: Clip) -> Clip:
    """The clip on the bent sheet: its normal turns with the inverse transpose of the bend's gradient."""
    x, y, z = (float(value) for value in _bend(np.array([clip.position]))[0])
    normal = np.array([-2.0 * x * (BEND[0] * clip.axis[1] + BEND[1] * clip.axis[2]), clip.axis[1], clip.axis[2]])
    normal /= np.linalg.norm(normal)
    return Clip(position=(x, y, z), axis=(float(normal[0]), float(normal[1]), float(normal[2])))


def _beam() -> tuple[Manifold, dict[str, Clip]]:
    from manifold3d import Manifold

    along_x = (0, 90, 0)
    outer = Manifold.cylinder(1.34, 0.030, circular_segments=48, center=True).rotate(along_x)
    inner = Manifold.cylinder(1.40, 0.028, circular_segments=48, center=True).rotate(along_x)
    parts = [_box((x - 0.003, x + 0.003), (-0.060, 0.060), (-0.075, 0.065)) for x in (-0.67, 0.67)]  # end plates
    parts += [_box((x - 0.002, x + 0.002), (-0.055, 0.020), (-0.120, 0.0)) for x in (-0.42, -0.30)]  # steering column's bracket
    parts.append(_box((-0.42, -0.30), (-0.055, 0.020), (-0.123, -0.119)))
    for x in (-0.09, 0.19):  # legs to the tunnel, leaning to the rear
        leg = _box((x - 0.018, x + 0.018), (-0.024, 0.024), (-0.40, 0.0))
        foot = _box((x - 0.030, x + 0.030), (-0.040, 0.040), (-0.404, -0.399))
        parts.append((leg + foot).rotate((8, 0, 0)))
    tab = _box((-0.012, 0.012), (-0.012, 0.045), (0.0275, 0.030))
    hole, lean = _hole(oval=True).translate((0, 0.034, 0.030)), 45.0
    holes = [_bolt_hole(x, y, z) for x in (-0.67, 0.67) for y in (-0.045, 0.045) for z in (-0.055, 0.050)]
    holes += [_bolt_hole(x, -0.035, -0.10) for x in (-0.42, -0.30)]
    clips: dict[str, Clip] = {}
    sine = math.sin(math.radians(lean))
    for index, x in enumerate(np.linspace(-0.58, 0.58, 8).tolist()):
        parts.append(tab.rotate((lean, 0, 0)).translate((x, 0, 0)))
        holes.append(hole.rotate((lean, 0, 0)).translate((x, 0, 0)))
        clips[f"tab_{index + 1}"] = Clip(position=(x, (0.034 - 0.030) * sine, (0.034 + 0.030) * sine), axis=(0.0, -sine, sine))
    # The bore is cut last, so that tabs, legs and bracket end at the tube instead of closing it.
    solid = _union([outer, *parts]) - _union(holes) - inner
    return solid.simplify(3e-5), clips


def _bolt_hole(x: float, y: float, z: float) -> Manifold:
    from manifold3d import Manifold

    return Manifold.cylinder(0.02, 0.005, circular_segments=20, center=True).rotate((0, 90, 0)).translate((x, y, z))


def _bent_prism(section: np.ndarray, across: tuple[float, float]) -> Manifold:
    """Prism over a closed section in (y, z), from x to x, bent; cut by the planes x = k STRIP."""
    from manifold3d import CrossSection, FillRule

    planes = STRIP * np.arange(math.floor(across[0] / STRIP) + 1, math.ceil(across[1] / STRIP))
    stations = np.array([across[0], *planes, across[1]])

    def place(points: np.ndarray) -> np.ndarray:
        x = stations[np.rint(points[:, 2]).astype(np.int64)]
        return _bend(np.stack([x, points[:, 0], points[:, 1]], axis=1))

    return CrossSection([section], FillRule.NonZero).extrude(len(stations) - 1.0, len(stations) - 2).warp_batch(place)


def _block(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Manifold:
    """Bent box."""
    return _bent_prism(np.array([(y[0], z[0]), (y[1], z[0]), (y[1], z[1]), (y[0], z[1])]), x)


def _box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Manifold:
    from manifold3d import Manifold

    return Manifold.cube((x[1] - x[0], y[1] - y[0], z[1] - z[0])).translate((x[0], y[0], z[0]))


def _union(parts: list[Any]) -> Manifold:
    from manifold3d import Manifold, OpType

    return Manifold.batch_boolean(parts, OpType.Add)
