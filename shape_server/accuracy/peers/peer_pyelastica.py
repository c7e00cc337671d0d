"""PyElastica: a Cosserat rod marched in time with explicit steps, its ends held by a constraint that moves.

How it is set up, and why (measured here):

- The clamped elements lie astride the ends of the cable, half before and half behind, as in `peer_mujoco`. A hinge holds the last node.
- Statics do not see inertia of spin, which with the true section allows steps of 1e-5 s. It is raised to half of an element's mass times
  its length squared, so that the axial wave limits the step: about 100 times longer.
- Axial and shear stiffness are equal and lowered until their error is that of the mesh; n=20 needs no more than 50 N (30 N is unstable).
  A rod that stretches has its own EA.
- Clamps move along straight lines during the steps of a motion; a jump would send a wave through the rod.
- 0.8 of the axial limit is stable with these settings in all four sequences, 0.9 is not. Compiling, 11 s, is not timed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from .collocation import Solved
from .motions import G, Motions, Need, Rod, element

NAME = "PyElastica"
DISTRIBUTION, VERSION = "pyelastica", (1, 0)
INSTALL = "Install it with pip install 'pyelastica>=1.0'."
REMEMBERS = True
FROM_STRAIGHT = False
CAN = frozenset(Need)

COURANT = 0.8  # step over the time that an axial wave needs for one element
BENDING_WAVES = 8.0  # EA over EI / h^2 below which bending limits the step
RADIUS = 1e-3  # m, of the section; it matters on a floor, for it becomes less with stretch
MOTION = 0.4  # s, of one motion of a single hard problem


@dataclass(frozen=True)
class Setting:
    """Mesh, and how a motion is relaxed."""

    segments: int
    axial: float  # N, EA and the shear stiffness
    steps: int  # per motion
    drag: float  # 1/s, force on a node over its mass and velocity

    def __str__(self) -> str:
        return f"n={self.segments}, EA {self.axial:g} N, {self.steps} steps, drag {self.drag:g}/s"


def sweep(motions: Motions) -> tuple[Setting, ...]:
    """Settings from coarse to fine; over a floor the rod is pulled, so that its EA tells, and bounces unless it is slowed down."""
    floor = ((20, 200.0, 100, 30.0), (20, 1e3, 400, 30.0), (20, 1e4, 800, 30.0))
    air = (
        (10, 50.0, 20, 3.0),
        (14, 50.0, 20, 3.0),
        (20, 50.0, 20, 2.0),
        (20, 50.0, 40, 3.0),
        (20, 50.0, 80, 3.0),
        (40, 200.0, 200, 3.0),
        (40, 200.0, 400, 3.0),
    )
    return tuple(Setting(*row) for row in (air if motions.floor is None else floor))


def careful(rod: Rod) -> Setting:
    """The setting for a single hard problem: so stiff along the axis that the axial wave limits the step."""
    segments = 40
    axial = max(200.0 * rod.weight, BENDING_WAVES * rod.bending * (segments / rod.length) ** 2)
    step = COURANT * rod.length / segments * float(np.sqrt(rod.weight / G / axial))
    return Setting(segments, axial, round(MOTION / step), 3.0)


def prepare(motions: Motions, first: Solved, setting: Setting) -> March:
    """The rod where the motions start."""
    import elastica

    class Simulator(elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing, elastica.Damping, elastica.Contact):
        """What PyElastica asks its users to put together."""

    class Held(elastica.ConstraintBase):
        """Keeps both ends in the clamps."""

        def __init__(self, *, clamps: Clamps, **given: Any) -> None:
            super().__init__(**given)
            self.clamps = clamps

        def constrain_values(self, system: Any, time: float) -> None:
            self.clamps.place(system)

        def constrain_rates(self, system: Any, time: float) -> None:
            system.velocity_collection[:, self.clamps.held_nodes] = self.clamps.velocity
            system.omega_collection[:, self.clamps.held_elements] = 0.0

    rod, h = motions.rod, element(motions, setting.segments)
    line = rod.weight / G  # kg/m
    # The last is what limits the step of a rod that is stiff for its mesh.
    stiffest = max(setting.axial, rod.stretch or 0.0, BENDING_WAVES * max(rod.bending, rod.bending_2 or 0.0) / h**2)
    step = COURANT * h * np.sqrt(line / stiffest)
    clamps = Clamps(h / 2, motions.is_hinged)
    clamps.hold(motions.position[0], motions.quaternion[0])
    body = _body(elastica.CosseratRod, motions, first, setting)
    clamps.place(body)
    simulator = Simulator()
    simulator.append(body)
    simulator.constrain(body).using(Held, clamps=clamps)
    simulator.add_forcing_to(body).using(elastica.GravityForces, acc_gravity=np.array([0.0, 0.0, -G]))
    if motions.floor is not None:
        origin = np.array([[0.0], [0.0], [motions.floor - float(body.radius[0])]])
        floor = elastica.Plane(origin, np.array([0.0, 0.0, 1.0]))
        simulator.append(floor)
        spring, damper = setting.axial / h, 0.5 * np.sqrt(setting.axial * line)  # as stiff as an element
        simulator.detect_contact_between(body, floor).using(elastica.RodPlaneContact, k=spring, nu=damper)
    simulator.dampen(body).using(elastica.AnalyticalLinearDamper, uniform_damping_constant=setting.drag, time_step=step)
    simulator.finalize()
    return March(simulator, elastica.PositionVerlet(), body, clamps, h, setting, step)


def _body(kind: Any, motions: Motions, first: Solved, setting: Setting) -> Any:
    rod, h = motions.rod, element(motions, setting.segments)
    count, line = setting.segments + (not motions.is_hinged), rod.weight / G
    x, z = np.eye(3)[[0, 2]]
    area = np.pi * RADIUS**2
    body = kind.straight_rod(count, np.zeros(3), x, z, count * h, RADIUS, line / area, youngs_modulus=setting.axial / area)
    spin = line * h**3 / 2  # kg m^2
    every = np.eye(3)[:, :, None]
    body.shear_matrix[:] = np.diag([setting.axial, setting.axial, rod.stretch or setting.axial])[:, :, None]
    body.bend_matrix[:] = np.diag([rod.bending, rod.bending_2 or rod.bending, rod.twist])[:, :, None]
    body.rest_kappa[:] = np.array(rod.bent)[:, None]
    body.mass_second_moment_of_inertia[:], body.inv_mass_second_moment_of_inertia[:] = spin * every, every / spin
    s = h * np.arange(count)
    body.director_collection[:] = Rotation.from_quat(first.frames(s)).as_matrix().transpose(2, 1, 0)
    body.position_collection[:, 1:-1] = first.positions(s[:-1] + h / 2).T
    return body


@dataclass
class Clamps:
    """Where the clamped elements are."""

    half: float  # m, of an element
    is_hinged: bool  # at the far end
    velocity: np.ndarray = field(default_factory=lambda: np.zeros((3, 1)))  # m/s, of the held nodes
    nodes: np.ndarray = field(default_factory=lambda: np.zeros((3, 0)))  # m
    frames: np.ndarray = field(default_factory=lambda: np.zeros((3, 3, 0)))  # directors in rows

    @property
    def held_nodes(self) -> list[int]:
        """Nodes that the clamps and the hinge place."""
        return [0, 1, -1] if self.is_hinged else [0, 1, -2, -1]

    @property
    def held_elements(self) -> list[int]:
        """Elements that the clamps turn."""
        return [0] if self.is_hinged else [0, -1]

    def hold(self, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put the clamps to (2, 3) [m] and (2, 4)."""
        axes = Rotation.from_quat(quaternion).as_matrix()
        (first, last), (a, b) = position, self.half * axes[:, :, 2]
        self.frames = axes.transpose(2, 1, 0)[:, :, : len(self.held_elements)]
        self.nodes = np.array([first - a, first + a, *([last] if self.is_hinged else [last - b, last + b])]).T

    def place(self, system: Any) -> None:
        """Put the rod's ends into the clamps."""
        system.position_collection[:, self.held_nodes] = self.nodes
        system.director_collection[:, :, self.held_elements] = self.frames


@dataclass
class March:
    """The simulator, which is where the last motion left it."""

    simulator: Any
    stepper: Any
    body: Any
    clamps: Clamps
    element: float  # m
    setting: Setting
    step: float  # s
    time: float = 0.0  # s

    @property
    def s(self) -> np.ndarray:
        """(n,) [m] Arc lengths of the nodes that are free."""
        return (np.arange(1, self.setting.segments - 1) + 0.5) * self.element

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
        """Nodes (n, 3) [m] after the clamps have moved."""
        before, count = self.clamps.nodes, self.setting.steps
        self.clamps.hold(position, quaternion)
        after = self.clamps.nodes
        self.clamps.velocity = (after - before) / (count * self.step)
        for part in np.arange(1, count + 1) / count:
            self.clamps.nodes = before + part * (after - before)
            self.time = self.stepper.step(self.simulator, self.time, self.step)
        return np.array(self.body.position_collection[:, 2 : self.setting.segments].T)
