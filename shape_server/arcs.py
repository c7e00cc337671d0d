"""An arc in which a cable without bending lies round a thick body without friction, which pushes it all along.

On the surface at a distance D about a line or a point, with n its outward normal and w the weight per metre,

    dx/ds = t,   dF/ds = -w - p n,   F = T t   [N],   p = T kappa - w . n >= 0   [N/m],

kappa = (1 - (t . d)^2) / D about a line along d, 1 / D about a point. So the tension follows the height alone, T + w . x = const, and the
force along the line changes by the weight's part in it.

Source: the balance of a thread on a smooth surface, Appell 1919, "Traite de mecanique rationnelle", vol. 1, ch. 7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from .slides import Hold, Slide

STEPS: Final = 32  # of the integration along an arc


@dataclass(frozen=True, eq=False)
class Arc:
    """Where a cable lies round a body.

    Attributes:
        slide: The contact.
        normal: (3,) Outward, where the arc begins.
        along: [m] From the contact's point along its line, there.
        s: [m] Of the cable, there.
        length: [m]
    """

    slide: Slide
    normal: np.ndarray
    along: float
    s: float
    length: float

    @property
    def begin(self) -> np.ndarray:
        """(3,) [m]."""
        out: np.ndarray = self.slide.point + self.along * self.slide.direction + self.slide.distance * self.normal
        return out

    def moved(self, step: np.ndarray) -> Arc:
        """Begun elsewhere on the surface, in two directions of it, the second along the line, and further on the cable; and longer [m]."""
        first, second = self._directions
        size = self.slide.distance
        normal = self.normal + (step[0] * first + (0.0 if self.slide.direction.any() else step[1]) * second) / size
        return replace(
            self,
            normal=normal / np.linalg.norm(normal),
            along=self.along + (step[1] if self.slide.direction.any() else 0.0),
            s=self.s + step[2],
            length=self.length + step[3],
        )

    @property
    def _directions(self) -> tuple[np.ndarray, np.ndarray]:
        """Two directions on the surface (3,), the second along the line if there is one."""
        d = self.slide.direction
        second = d if d.any() else np.cross(self.normal, np.eye(3)[int(np.argmin(np.abs(self.normal)))])
        second = second / np.linalg.norm(second)
        return np.cross(second, self.normal), second


@dataclass(frozen=True, eq=False)
class Laid:
    """An arc as it is: places, forces and pressures at `s` along it."""

    s: np.ndarray  # (m,) m, of the cable
    nodes: np.ndarray  # (m, 3) m
    force: np.ndarray  # (m, 3) N, of the part after on the part before
    pressure: np.ndarray  # (m,) N/m
    curvature: np.ndarray  # (m,) 1/m
    normal: np.ndarray  # (m, 3) outward

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nodes (k, 3) [m] at arc lengths of the cable (k,) [m], tension (k,) [N] and curvature (k,) [1/m]: cubic between those known.

        The nodes are outside by as much as the segments between them would cut into the body.
        """
        step, last = self.s[1] - self.s[0], len(self.s) - 2
        row = np.clip(((s - self.s[0]) / step).astype(int), 0, last)
        u = np.clip((s - self.s[row]) / step, 0.0, 1.0)[:, None]
        tension = np.linalg.norm(self.force, axis=1)
        tangent = self.force / tension[:, None]
        nodes = (1 + 2 * u) * (1 - u) ** 2 * self.nodes[row] + u**2 * (3 - 2 * u) * self.nodes[row + 1]
        nodes += step * u * (1 - u) * ((1 - u) * tangent[row] - u * tangent[row + 1])
        bulge = 0.125 * float(self.curvature.max()) * float((s[1:] - s[:-1]).max(initial=0.0)) ** 2
        nodes += bulge * ((1 - u) * self.normal[row] + u * self.normal[row + 1])
        return nodes, np.interp(s, self.s, tension), np.interp(s, self.s, self.curvature)


def lie(arc: Arc, force: np.ndarray, load: np.ndarray) -> Laid:
    """The arc that begins with a force (3,) [N], of which only the part along the surface is taken (Runge and Kutta, fourth order)."""
    slide, h = arc.slide, arc.length / STEPS
    (u, v, w), (p, q, r), size = slide.direction.tolist(), slide.point.tolist(), slide.distance
    load_x, load_y, load_z = load.tolist()
    pull = force - (force @ arc.normal) * arc.normal
    state = (*(arc.begin - slide.point).tolist(), *pull.tolist())
    rows, pressures = [state], []

    def outward(x: float, y: float, z: float) -> tuple[float, float, float]:
        along = x * u + y * v + z * w
        x, y, z = x - along * u, y - along * v, z - along * w
        away = math.sqrt(x * x + y * y + z * z)
        return x / away, y / away, z / away

    def slope(at: tuple[float, ...], by: tuple[float, ...] = (0.0,) * 6, step: float = 0.0) -> tuple[float, ...]:
        x, y, z, f, g, k = (a + step * b for a, b in zip(at, by, strict=True))
        n_x, n_y, n_z = outward(x, y, z)
        tension = max(math.sqrt(f * f + g * g + k * k), 1e-300)
        f, g, k = f / tension, g / tension, k / tension
        push = tension * (1.0 - (f * u + g * v + k * w) ** 2) / size - (load_x * n_x + load_y * n_y + load_z * n_z)
        return f, g, k, -load_x - push * n_x, -load_y - push * n_y, -load_z - push * n_z, push

    for _ in range(STEPS):
        a = slope(state)
        b = slope(state, a[:6], 0.5 * h)
        c = slope(state, b[:6], 0.5 * h)
        d = slope(state, c[:6], h)
        pressures.append(a[6])
        x, y, z, f, g, k = (state[i] + h / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i]) for i in range(6))
        n_x, n_y, n_z = outward(x, y, z)
        along, inward = x * u + y * v + z * w, f * n_x + g * n_y + k * n_z
        state = (
            along * u + size * n_x, along * v + size * n_y, along * w + size * n_z,
            f - inward * n_x, g - inward * n_y, k - inward * n_z,
        )  # fmt: skip
        rows.append(state)
    pressures.append(slope(state)[6])
    told = np.array(rows)
    tangent = told[:, 3:] / np.linalg.norm(told[:, 3:], axis=1)[:, None]
    curvature = (1.0 - (tangent @ slide.direction) ** 2) / size
    return Laid(
        s=arc.s + h * np.arange(STEPS + 1),
        nodes=told[:, :3] + np.array([p, q, r]),
        force=told[:, 3:],
        pressure=np.array(pressures),
        curvature=curvature,
        normal=np.array([outward(*row) for row in told[:, :3].tolist()]),
    )


def place_of(stop: Hold | Arc) -> np.ndarray:
    """Where a held point is, or an arc begins, (3,) [m]."""
    return stop.place if isinstance(stop, Hold) else stop.begin


def unit(vector: np.ndarray) -> np.ndarray:
    """The vector (3,) with length 1."""
    out: np.ndarray = vector / max(float(np.linalg.norm(vector)), 1e-300)
    return out
