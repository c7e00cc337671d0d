"""Symmetries: what turning, moving, mirroring, other units and naming a cable from its other end make of a problem and of its shape."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from protocol.messages import Contacts, Grasps, Problem, Shape, Start
from protocol.scene import Cable, Vector

OVER = Rotation.from_rotvec([np.pi, 0.0, 0.0])  # of a frame, when its cable is named from the other end


@dataclass(frozen=True)
class Image:
    """x -> length (turn mirror x) + shift; forces by `force` times that without the shift."""

    turn: Rotation = field(default_factory=Rotation.identity)
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    is_mirrored: bool = False  # in the plane x-z, before the turn
    length: float = 1.0
    force: float = 1.0
    is_reversed: bool = False

    def directions(self, x: np.ndarray) -> np.ndarray:
        """Of vectors (n, 3) without a unit."""
        return np.asarray(self.turn.apply(x * (1.0, -1.0, 1.0) if self.is_mirrored else x))

    def points(self, x: np.ndarray) -> np.ndarray:
        """Of places (n, 3) [m]."""
        return self.length * self.directions(x) + self.shift

    def frames(self, q: np.ndarray) -> np.ndarray:
        """Of frames (n, 4) of the cable; d2 of a mirrored one is what makes it right-handed again."""
        matrix = Rotation.from_quat(q).as_matrix()
        if self.is_mirrored:
            matrix = matrix * np.array([1.0, -1.0, 1.0])[:, None] * np.array([1.0, -1.0, 1.0])
        turned = self.turn * Rotation.from_matrix(matrix)
        return self.ordered(np.asarray((turned * OVER if self.is_reversed else turned).as_quat()))

    def ordered(self, rows: np.ndarray) -> np.ndarray:
        """Rows in the order of growing arc length."""
        return np.ascontiguousarray(rows[::-1] if self.is_reversed else rows)

    def places(self, s: np.ndarray, whole: float) -> np.ndarray:
        """Of arc lengths (n,) [m] on a cable of a length [m]."""
        return self.length * self.ordered(whole - s if self.is_reversed else s)

    def gravity(self, g: Vector) -> Vector:
        """With the cable's mass in `problem`, the weight becomes `force` times as much."""
        x, y, z = self.directions(np.array([g]))[0].tolist()
        return (x, y, z)

    def cable(self, cable: Cable) -> Cable:
        """A cable in those units."""
        size, stiffness = self.length, self.force * self.length**2
        assert cable.bending is not None
        assert cable.twist is not None
        return replace(
            cable,
            length=size * cable.length,
            diameter=size * cable.diameter,
            mass_per_length=self.force / size * cable.mass_per_length,
            bending=stiffness * cable.bending,
            twist=stiffness * cable.twist,
        )

    def problem(self, problem: Problem) -> Problem:
        """The problem as it looks then, in units in which g stays as it is and time too."""
        cable, held, changed = problem.cable, problem.grasps, self.cable(problem.cable)
        grasps = Grasps(
            s=self.places(held.s, cable.length),
            position=self.ordered(self.points(held.position)),
            quaternion=self.frames(held.quaternion),
            hold=held.hold[::-1] if self.is_reversed else held.hold,
        )
        contacts = None if problem.contacts is None else self._contacts(problem.contacts, cable.length)
        start = None
        if problem.start is not None:
            start = Start(
                s=self.places(problem.start.s, cable.length),
                frames=self.frames(problem.start.frames),
                grasp_forces=self.ordered(self.force * self.directions(problem.start.grasp_forces)),
            )
        return msgspec.structs.replace(problem, cable=changed, grasps=grasps, contacts=contacts, start=start)

    def _contacts(self, rows: Contacts, whole: float) -> Contacts:
        columns = {name: getattr(rows, name) for name in rows.__struct_fields__}
        rubbing = rows.rubbing
        if rubbing is not None:
            last = len(rows.s) - 1
            rubbing = msgspec.structs.replace(
                rubbing,
                contact=self.ordered(last - rubbing.contact if self.is_reversed else rubbing.contact),
                law=self.ordered(rubbing.law),
                s=self.places(rubbing.s, whole),
                anchor=self.ordered(self.points(rubbing.anchor)),
                laws=tuple(msgspec.structs.replace(law, speed=self.length * law.speed) for law in rubbing.laws),
            )
        columns |= {name: self.ordered(getattr(rows, name)) for name in ("body", "feature", "friction")}
        columns |= {name: self.ordered(self.directions(getattr(rows, name))) for name in ("normal", "direction")}
        columns["s"] = self.places(rows.s, whole)
        columns["point"] = self.ordered(self.points(rows.point))
        columns["extent"] = self.length * self.ordered(rows.extent)
        columns["distance"] = self.length * self.ordered(rows.distance)
        columns["force"] = self.ordered(self.force * self.directions(rows.force))
        return Contacts(**{**columns, "rubbing": rubbing})

    def off(self, shape: Shape, seen: Shape) -> tuple[float, float]:
        """How far the shape that was seen is from the image of the other: nodes over the length, and forces over the largest."""
        nodes = float(np.abs(seen.nodes - self.ordered(self.points(shape.nodes))).max()) / float(seen.s[-1])
        wrench = self.ordered(self.force * self.directions(shape.grasp_wrenches[:, :3]))
        contact = self.ordered(self.force * self.directions(shape.contact_forces))
        largest = float(np.abs(seen.grasp_wrenches[:, :3]).max())
        forces = np.abs(seen.grasp_wrenches[:, :3] - wrench).max(), np.abs(seen.contact_forces - contact).max(initial=0.0)
        return nodes, float(max(forces)) / largest
