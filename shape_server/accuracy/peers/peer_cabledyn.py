"""CableDyn: cubic Hermite elements with bending, whose static solve is a load continuation; made for mooring lines and power cables.

It has no static solve from the last shape: every motion is a deck of its own that is solved afresh, so only motions with a reference are
run. In the plane the library is called in this process. A line restrained in torsion is refused there and needs the stand-alone
driver: the spatial rod costs one start of a program per motion, which is part of the time.

- The far clamp is end A, which must not lie below end B. Directions point from A to B, against the tangent.
- Clamps turned by 180 degrees are one pose; `Pretwist` tells the branch, so the far frame is turned back by as much.
- The line floats neither up nor down: its diameter is a micron, and the water as thin as air. Its EA shifts the shape: by 1.7e-4 of
  the length at 1e3 N, 1.5e-5 at 1e4 N.
- A rod that stretches is another one there: where n.d3 / EA at a clamp is 0.2 % it has 1.1 %, on any mesh, and the shape is 7.5e-4 of the
  length away. It is not asked for such rods.
- It refines a mesh by itself where that does not resolve the curvature. Only nodes of the deck have a known arc length.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from .collocation import Solved
from .motions import Motions, Need, Rod

NAME = "CableDyn statics"
DISTRIBUTION, VERSION = "cabledyn", (0, 3)
INSTALL = "Install it with pip install 'cabledyn>=0.3'."
REMEMBERS = False
FROM_STRAIGHT = False
CAN = frozenset([Need.HINGE, Need.FLOOR])

GRAVITY = 9.80665  # m/s^2
DEPTH = 50.0  # m, of the cable below the surface of the water
DIAMETER = 1e-6  # m
BED = 1e12  # Pa/m, of the floor: a cable of 1 N/m sinks in by 1e-6 m


@dataclass(frozen=True)
class Setting:
    """Mesh and stiffness."""

    segments: int
    axial: float  # N, EA

    def __str__(self) -> str:
        return f"n={self.segments}, EA {self.axial:g} N"


def sweep(motions: Motions) -> tuple[Setting, ...]:
    """Settings from coarse to fine."""
    rows = ((20, 1e4), (40, 1e3), (80, 1e4), (160, 1e5)) if motions.is_planar else ((30, 1e3), (40, 1e4), (80, 1e4))
    return tuple(Setting(*row) for row in rows)


def careful(_rod: Rod) -> Setting:
    """The setting for a single hard problem."""
    return Setting(160, 1e5)


def prepare(motions: Motions, _first: Solved, setting: Setting) -> Statics:
    """A folder for the decks."""
    import cabledyn

    folder = Path(tempfile.mkdtemp(prefix="cabledyn_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    driver = None if motions.is_planar else cabledyn.CableDynDriver()
    refusals = (cabledyn.CableDynError, cabledyn.DriverError)
    return Statics(cabledyn.CableDyn, driver, refusals, motions, setting, folder)


@dataclass
class Statics:
    """The library, or the driver, and where its decks lie."""

    library: Any
    driver: Any | None
    refusals: tuple[type[Exception], ...]  # what they raise where they find no shape
    motions: Motions
    setting: Setting
    folder: Path

    @property
    def s(self) -> np.ndarray:
        """(n,) [m] Arc lengths of the deck's nodes, from end A."""
        return np.linspace(self.motions.rod.length, 0.0, self.setting.segments + 1)

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
        """Nodes (n, 3) [m] with the clamps at (2, 3) [m] and (2, 4)."""
        deck = self.folder / "deck.dat"
        deck.write_text(_deck(self.motions, self.setting, position, quaternion), encoding="utf-8")
        try:
            return np.asarray(self._solve(deck) + np.array([0.0, 0.0, DEPTH]))
        except self.refusals:
            return np.full((self.setting.segments + 1, 3), np.nan)

    def _solve(self, deck: Path) -> np.ndarray:
        if self.driver is None:
            with self.library(deck) as model:
                line = model.line(1)
                return np.asarray(line.node_positions()[line.deck_nodes > 0])
        found = self.driver.run(deck, deck.with_name("out"), overwrite=True, timeout=60)
        table = np.loadtxt(found.static_output, skiprows=3)  # X, Y and Z are columns 3 to 5, the last is the deck's node or 0
        return np.asarray(table[table[:, -1] > 0, 3:6])


def _deck(motions: Motions, setting: Setting, position: np.ndarray, quaternion: np.ndarray) -> str:
    """The deck; without torsion where the rod is planar."""
    rod, has_torsion = motions.rod, not motions.is_planar
    frames = Rotation.from_quat(quaternion)
    tangent, normal = frames.apply([0.0, 0.0, 1.0]), frames.apply([1.0, 0.0, 0.0])
    stiffness = f"{setting.axial:g} {rod.twist:.15g} 1e-6 1e-6 " if has_torsion else ""
    torsion = ("", "")
    if has_torsion:
        normal[1] = (frames[1] * Rotation.from_rotvec((0.0, 0.0, -motions.end_twist))).apply([1.0, 0.0, 0.0])
        torsion = f"Rigid {_row(normal[0])}", f"Rigid {_row(normal[1])} {-np.degrees(motions.end_twist):.15g}"
    bed = "" if motions.floor is None else f"{DEPTH - motions.floor:.15g} WtrDpth\n{BED:g} kBot\n0 cBot\n"
    places = [_row(place - np.array([0.0, 0.0, DEPTH])) for place in position]
    return f"""--- CableDyn Input File ---
One motion
--- LINE TYPES ---
Name Diam Mass EA BA EI {"GAs GJ Irt Irn " if has_torsion else ""}Cd_n Cd_t Ca_n Ca_t
(-) (m) (kg/m) (N) (N-s) (N-m^2) {"(N) (N-m^2) (kg-m) (kg-m) " if has_torsion else ""}(-) (-) (-) (-)
cable {DIAMETER:g} {rod.weight / GRAVITY:.15g} {setting.axial:g} 0 {rod.bending:.15g} {stiffness}0 0 0 0
--- POINTS ---
ID Type X Y Z Mass Vol CdA Ca
(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Coupled {places[1]} 0 0 0 0
2 Fixed {places[0]} 0 0 0 0
--- LINES ---
ID NodeA NodeB Outputs
(-) (-) (-) (-)
1 1 2 -
--- SECTIONS ---
LineID LineType Length NumSegs
(-) (-) (m) (-)
1 cable {rod.length:.15g} {setting.segments}
--- END CONNECTIONS ---
LineID End Stiffness EzX EzY EzZ {"TorsStiffness NxX NxY NxZ Pretwist" if has_torsion else ""}
(-) (-) (N-m/rad) (-) (-) (-) {"(N-m/rad) (-) (-) (-) (deg)" if has_torsion else ""}
1 A {"Pinned" if motions.is_hinged else "Rigid"} {_row(-tangent[1])} {torsion[1]}
1 B Rigid {_row(-tangent[0])} {torsion[0]}
--- OPTIONS ---
{GRAVITY} g
1.0 rhoW
0.01 dtM
0.0 TMax
{bed}--- need this line ---
"""


def _row(vector: np.ndarray) -> str:
    return " ".join(f"{value:.15g}" for value in vector)
