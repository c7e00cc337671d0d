"""MuJoCo 4: a one-dimensional flex with elasticity, which is a discrete elastic rod, relaxed by its implicit integrator.

How it is set up, and why (user documentation of 4.0.0, "Rods" and "flex/elasticity", and what was measured here):

- The clamped edges lie astride the ends of the cable, half a segment before and half behind, which makes the clamp second order; an edge
  that begins at the end makes it first order. So the rod has one edge more than the cable has segments. A hinge holds the last vertex; the
  first edge then needs a twist joint too, so that it is held in a plane only.
- Each clamp is a mocap body that carries two vertices, hence a raw `flex`, whose twist joints must be declared with their names. Mocap
  allows no elastic damping; drag on the nodes is refused in the file ("cannot have joint damping") but accepted in the compiled
  model, where it is implicit. It does not move the equilibrium.
- Edges are held by soft constraints: the defaults stretch them by 2 to 40 %; `solimp` at its cap of 0.9999 and a short `solref` by 1e-6 to
  1e-2, growing with the square of the step. So a long step settles soon and is less exact: the settings trade these.
- A step is a linear problem without contacts, so one iteration of Newton's method is enough (up to 1.4 times as fast, same shapes).
- Radius and moduli only enter as EI and GJ, and as the polar inertia of the twist joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .collocation import Solved
from .motions import LEVEL, G, Motions, Need, Rod, approach, element

NAME = "MuJoCo 4 flex rod"
DISTRIBUTION, VERSION = "mujoco", (4, 0)
INSTALL = "Install it with pip install 'mujoco>=4.0'."
REMEMBERS = True
FROM_STRAIGHT = True  # is led to where it starts
CAN = frozenset([Need.HINGE])

RADIUS = 3e-3  # m
SCALAR_FIRST = [3, 0, 1, 2]
ARRIVE, REST = 10.0, 10.0  # s, of the way from the straight rod to where the motions start, and of rest there


@dataclass(frozen=True)
class Setting:
    """Mesh, and how a motion is relaxed."""

    segments: int
    step: float  # s
    steps: int  # per motion
    drag: float  # 1/s, force on a node over its mass and velocity

    def __str__(self) -> str:
        return f"n={self.segments}, {self.steps} x {self.step:g} s, drag {self.drag:g}/s"


def sweep(_motions: Motions) -> tuple[Setting, ...]:
    """Settings from coarse to fine; what was left of about 230."""
    rows = (
        (10, 0.1, 1, 5.0),
        (14, 0.1, 1, 5.0),
        (20, 0.1, 1, 5.0),
        (30, 0.15, 1, 5.0),
        (40, 0.1, 1, 5.0),
        (40, 0.1, 2, 5.0),
        (40, 0.2, 2, 2.0),
        (60, 0.05, 3, 3.0),
        (60, 0.1, 4, 2.0),
        (60, 0.05, 6, 2.0),
        (80, 0.05, 8, 2.0),
        (80, 0.03, 16, 8.0),
        (80, 0.03, 16, 4.0),
        (120, 0.015, 30, 8.0),
    )
    return tuple(Setting(*row) for row in rows)


def careful(_rod: Rod) -> Setting:
    """The setting for a single hard problem: short steps, without which soft rods fly apart."""
    return Setting(40, 0.005, 100, 8.0)


def prepare(motions: Motions, _first: Solved, setting: Setting) -> Relaxation:
    """A rod at rest where the motions start, led there from a straight one so that it has the right twist."""
    import mujoco

    mujoco.set_mju_user_warning(lambda _text: None)  # one iteration leaves the smooth acceleration rough, and it says so
    model = mujoco.MjModel.from_xml_string(_model(motions, setting))
    nodes = 3 * (setting.segments - 2)
    model.dof_damping[:nodes] = setting.drag * np.repeat(model.body_mass[3 : setting.segments + 1], 3)
    model.dof_damping[nodes:] = setting.drag * model.body_inertia[setting.segments + 1 :, 0]
    relaxation = Relaxation(mujoco.mj_step, model, mujoco.MjData(model), element(motions, setting.segments), setting)
    poses = list(approach(motions, 100))
    for position, quaternion in poses:
        relaxation.hold(position, quaternion)
        mujoco.mj_step(model, relaxation.data, round(ARRIVE / setting.step / len(poses)) + 1)
    mujoco.mj_step(model, relaxation.data, round(REST / setting.step))
    return relaxation


@dataclass
class Relaxation:
    """Model and state, which is where the last motion left it."""

    mj_step: Any
    model: Any
    data: Any
    element: float  # m
    setting: Setting

    @property
    def s(self) -> np.ndarray:
        """(n,) [m] Arc lengths of the nodes that are free."""
        return (np.arange(1, self.setting.segments - 1) + 0.5) * self.element

    def hold(self, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put the clamps to (2, 3) [m] and (2, 4)."""
        self.data.mocap_pos[:] = position
        self.data.mocap_quat[:] = quaternion[:, SCALAR_FIRST]

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
        """Nodes (n, 3) [m] after the clamps have moved."""
        self.hold(position, quaternion)
        self.mj_step(self.model, self.data, self.setting.steps)
        return np.array(self.data.flexvert_xpos[2 : self.setting.segments])


def _model(motions: Motions, setting: Setting) -> str:
    """MJCF of the rod, straight along x between two mocap bodies whose third axis is the tangent."""
    rod, count, h = motions.rod, setting.segments, element(motions, setting.segments)
    mass = rod.weight / G * h
    polar = mass * RADIUS**2 / 2
    young, shear = rod.bending / (np.pi * RADIUS**4 / 4), rod.twist / (np.pi * RADIUS**4 / 2)
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    nodes = "".join(
        f'<body name="node_{i}" pos="{h * (i - 0.5):.15g} 0 0">'
        f'<inertial pos="0 0 0" mass="{mass:.15g}" diaginertia="{polar:.9g} {polar:.9g} {polar:.9g}"/>{slides}</body>'
        for i in range(2, count)
    )
    twists = "".join(
        f'<body name="rod_twist_{i}"><inertial pos="0 0 0" mass="1e-9" diaginertia="{polar:.9g} {polar:.9g} {polar:.9g}"/>'
        f'<joint name="rod_twist{f"_{i}" if i else ""}" axis="1 0 0"/></body>'
        for i in range(0 if motions.is_hinged else 1, count)
    )
    held = 1 if motions.is_hinged else 2  # vertices at the far end
    vertices = np.zeros((count + held, 3))  # in the frames of their bodies
    vertices[0, 2], vertices[1, 2] = -h / 2, h / 2
    if held == 2:
        vertices[-2, 2], vertices[-1, 2] = -h / 2, h / 2
    bodies = " ".join(["start start", *(f"node_{i}" for i in range(2, count)), *["end"] * held])
    level = " ".join(f"{value:.17g}" for value in LEVEL.as_quat()[SCALAR_FIRST])
    return f"""<mujoco>
<option timestep="{setting.step:g}" gravity="0 0 {-G}" integrator="discrete" solver="Newton" jacobian="sparse" iterations="1"
 ls_iterations="1"><flag contact="disable"/></option>
<worldbody><body name="start" mocap="true" quat="{level}"/>
<body name="end" mocap="true" pos="{rod.length:g} 0 0" quat="{level}"/>{nodes}{twists}</worldbody>
<deformable><flex name="rod" dim="1" radius="{RADIUS:g}" body="{bodies}"
 vertex="{" ".join(f"{value:.15g}" for value in vertices.ravel())}" element="{" ".join(f"{i} {i + 1}" for i in range(count + held - 1))}">
<elasticity young="{young:.15g}" shear="{shear:.15g}"/></flex></deformable>
<equality><flex flex="rod" solref="0.0001 1" solimp="0.9999 0.9999"/></equality></mujoco>"""
