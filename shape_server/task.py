"""What one piece of cable is asked for, and how far its solution has come."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType
from typing import Any, Final

import numpy as np

from protocol.messages import Problem
from protocol.scene import Vector

from . import effects
from .clock import Clock
from .contact_geometry import FACE
from .descent import Progress
from .equilibrium import Settled
from .mesh import Mesh
from .reading import Reading, read, read_mended
from .system import System, build, grouped, micro_length

KINK: Final = 0.1  # of the tolerance; a point load that bends the cable aside by less, within its layer, is not looked at more closely


@dataclass(frozen=True)
class Task:
    """One problem without clamps inside it, and what is wanted of its answer."""

    problem: Problem
    gravity: Vector
    tolerance: float  # m
    budget: float | None  # s, in place of the tolerance
    extrapolate: bool  # whether shapes of two meshes may be combined
    margin: bool  # whether the stability margin is wanted
    used: tuple[str, ...]  # effects
    path: ModuleType
    progress: Progress
    begun: float = field(default_factory=time.perf_counter)
    reach: int = 1  # segments to either side of a contact on which it may be found

    def system(self, mesh: Mesh) -> System:
        """The equations on a mesh."""
        touching, contacts = self._touching, self.problem.contacts
        if self.budget is not None and touching is not None and contacts is not None and contacts.rubbing is None:
            touching = effects.load("contact").thinned(contacts, touching, mesh)
        return build(self.problem, self.gravity, self.used, mesh, touching)

    @cached_property
    def _touching(self) -> Any:
        return grouped(self.problem, self.used, self.reach)

    @property
    def touches(self) -> bool:
        """Whether the cable may touch anything; what touches changes with the mesh, so that no two of them combine."""
        return self.problem.contacts is not None or self.problem.self_contacts is not None

    @property
    def clock(self) -> Clock | None:
        """What keeps the budget, if there is one."""
        return self.progress if isinstance(self.progress, Clock) else None

    @property
    def seconds(self) -> float:
        """[s] Since the task was begun."""
        return time.perf_counter() - self.begun


@dataclass(frozen=True)
class Solution:
    """A settled rod on one mesh, and what it says, read when it is asked for."""

    task: Task
    system: System
    found: Settled

    @cached_property
    def reading(self) -> Reading:
        """All that it says."""
        return read(self.task.problem, self.system, self.found, self.task.path)

    @cached_property
    def mended(self) -> Reading:
        """All that it says once its half cells at clamps are mended, to be combined with another mesh."""
        return read_mended(self.task.problem, self.system, self.found, self.task.path)

    @cached_property
    def sections(self) -> tuple[np.ndarray, np.ndarray]:
        """Tension (n-1,) [N] and curvature (n,) [1/m] alone."""
        tension, curvature, *_ = self.task.path.section_forces(self.system.rod, self.found.state, self.found.seen)
        return tension, curvature

    @property
    def lies(self) -> bool:
        """Whether the cable lies on faces, at three places at least; on edges and vertices contacts slide without regard to nodes.

        A cable too soft to round its nodes lies on wide bodies just so.
        """
        rows = self.system.rod.touch[: self.system.body_rows][self.found.state.push[: self.system.body_rows] > 0.0]
        return bool(((rows["feature"] == FACE) | (rows["is_straight"] == 1)).sum() >= 3)

    @property
    def is_kinked(self) -> bool:
        """Whether the cable bends to its least radius somewhere: there its law has a kink, and its curvature another."""
        limit = self.system.rod.elastic.limit
        return bool(len(limit) and (self.sections[1] > limit[0]).any())

    def layers(self) -> tuple[np.ndarray, np.ndarray]:
        """Places (k,) [m] where boundary layers may be, and their lengths sqrt(EI / T) (k,) [m], T the force carried there.

        A clamp, a contact or a point load bends the cable over this length; a micro-structure length, if shorter, is a layer in the layer.
        """
        mesh, touch = self.system.mesh, self.system.rod.touch
        on = np.flatnonzero(self.found.state.push[: self.system.body_rows] > 0.0)
        touched = mesh.s[touch["element"][on]] + self.found.state.fraction[on] * mesh.lengths[touch["element"][on]]
        loaded, load = self._loaded
        own = self.reading.self_places[self.reading.self_push > 0.0].ravel()
        places = np.concatenate([self.stops, touched, own, loaded])
        layers, beside, _ = self._layers_at(places)
        turn = np.minimum(np.concatenate([np.full(len(places) - len(load), np.inf), load]) / beside, np.pi)
        matters = layers * turn > KINK * self.task.tolerance
        matters[: len(places) - len(load)] = True
        return places[matters], layers[matters]

    @property
    def hidden(self) -> float:
        """Curvature [1/m] at loads whose layers the segments are too long to show: P / 2 sqrt(EI T), a pulled beam's under a force P.

        Timoshenko 1955, "Strength of Materials", part II, ch. 2.
        """
        places, load = self._loaded
        if not len(places) or not len(self.system.rod.elastic.law):
            return 0.0
        layers, beside, lengths = self._layers_at(places)
        return float((np.where(lengths > layers, load, 0.0) / (2.0 * layers * beside)).max())

    def _layers_at(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lengths of the layers [m] there would be at places (k,) [m], the forces carried there [N], and the segments' lengths [m]."""
        rod, mesh = self.system.rod, self.system.mesh
        segment, _ = mesh.locate(places)
        force, before = np.abs(self.reading.tension), np.maximum(segment - 1, 0)
        beside = np.maximum(np.maximum(force[segment], force[before]), 1e-300)
        law = rod.elastic.law[:, :2].min(axis=1)
        layers = np.sqrt(np.minimum(law[segment], law[before]) / beside)
        if len(rod.elastic.smoothing):
            layers = np.minimum(layers, micro_length(rod.elastic.law, rod.elastic.smoothing, rod.lengths))
        return layers, beside, mesh.lengths[segment]

    @property
    def _loaded(self) -> tuple[np.ndarray, np.ndarray]:
        """Arc lengths (k,) [m] of lumped masses and point loads, and their forces (k,) [N]."""
        masses, loads, pull = self.task.problem.cable.masses, self.task.problem.loads, math.hypot(*self.task.gravity)
        at, force = [mass.at for mass in masses], [mass.mass * pull for mass in masses]
        if loads is not None:
            at, force = [*at, *loads.s.tolist()], [*force, *np.linalg.norm(loads.force, axis=1).tolist()]
        return np.array(at), np.array(force)

    @property
    def stops(self) -> np.ndarray:
        """(k,) [m] Ends and held points."""
        mesh = self.system.mesh
        return np.unique(np.concatenate([mesh.s[[0, -1]], mesh.s[mesh.grasp_nodes]]))
