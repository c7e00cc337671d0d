"""Pictures of a frame without a display, drawn by PyBullet's TinyRenderer.

The only other places that import PyBullet are the world and the robot of the environment. This one does too because its
software renderer is already installed with them, draws concave solids as they are (a visual shape is never a convex
hull) and needs neither a screen nor OpenGL. It is imported when the first picture is drawn.
"""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from protocol.messages import Frame, Snapshot

from .surface import Floats, Surface, bisected, smoothed
from .tube import tube
from .view import DIRECTIONS, View, fit_view

if TYPE_CHECKING:
    from PIL import Image

CABLE_COLORS: Final = ((0.96, 0.42, 0.05), (0.05, 0.55, 0.75), (0.55, 0.25, 0.75), (0.25, 0.65, 0.20))
CONTACT_COLOR: Final = (200, 0, 60)
BACKGROUND: Final = ((247, 249, 251), (214, 220, 227))  # top and bottom of the picture
LIGHT: Final = (-0.55, 0.35, 1.0)  # towards the light: above, behind the robot's left shoulder
OVERSAMPLING: Final = 2
EDGE_MAX: Final = 0.06  # m; the renderer visits the whole bounding box of a triangle, so long slanted ones cost most
PREVIEW: Final = 120  # pixel, height of the small picture in which it is seen what hides the cable
PREVIEW_DEPTH: Final = 0.03  # m; less far in front of a node is the cable itself
VISIBLE_ENOUGH: Final = 0.85  # of the cable's nodes
PIECE: Final = 30_000  # triangles of one visual shape; PyBullet refuses some 240 000
NEAR, FAR = 0.05, 20.0  # m, depth range of the renderer

Bytes = npt.NDArray[np.uint8]


def draw(snapshot: Snapshot, frame: Frame, path: Path, *, width: int = 1280, height: int = 800, view: View | None = None) -> None:
    """Store one picture as PNG; for several of one run, keep a `Studio`.

    Args:
        snapshot: Of the run.
        frame: Of the same run.
        path: File to write; an existing one is replaced.
        width: [pixel]
        height: [pixel]
        view: Where to look from; by default the first of `DIRECTIONS` from which solids hide little of the cable.
    """
    with Studio(snapshot) as studio:
        studio.draw(frame, path, width=width, height=height, view=view)


class Studio:
    """The solids of a run, ready to be drawn at the poses of any frame. Use in a `with` statement."""

    def __init__(self, snapshot: Snapshot) -> None:
        import pybullet

        self._bullet = pybullet
        self._world: int = pybullet.connect(pybullet.DIRECT)
        self._snapshot = snapshot
        self._direction = DIRECTIONS[0]  # the last picture's, so that a run is seen from one side where possible
        self._solids = [
            [self._add(piece, solid.color) for piece in _pieces(bisected(smoothed(solid.vertices, solid.triangles), EDGE_MAX))]
            for solid in snapshot.solids
        ]

    def draw(self, frame: Frame, path: Path, *, width: int = 1280, height: int = 800, view: View | None = None) -> None:
        """Store a picture of one frame as PNG, see `draw`."""
        from PIL import Image

        self._pose(frame)
        cables = self._add_cables(frame)
        view = view or self._clear_view(frame, width / height)
        pixels, depth = self._render(view, OVERSAMPLING * width, OVERSAMPLING * height)
        for body in cables:
            self._bullet.removeBody(body, physicsClientId=self._world)
        large = Image.fromarray(pixels)
        _mark_contacts(large, depth, view, frame, self._snapshot)
        picture = large.resize((width, height), Image.Resampling.LANCZOS)
        _write_caption(picture, frame)
        picture.save(path, format="PNG")

    def close(self) -> None:
        """Give the renderer's memory back."""
        if self._world >= 0:
            self._bullet.disconnect(physicsClientId=self._world)
            self._world = -1

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _add(self, surface: Surface, color: tuple[float, float, float]) -> int:
        visual = self._bullet.createVisualShape(
            self._bullet.GEOM_MESH,
            vertices=surface.vertices.tolist(),
            indices=surface.triangles.reshape(-1).tolist(),
            normals=surface.normals.tolist(),
            rgbaColor=[*color, 1.0],
            specularColor=[0.1, 0.1, 0.1],
            physicsClientId=self._world,
        )
        body: int = self._bullet.createMultiBody(0, -1, visual, physicsClientId=self._world)
        return body

    def _pose(self, frame: Frame) -> None:
        for bodies, pose in zip(self._solids, frame.poses.tolist(), strict=True):
            for body in bodies:
                self._bullet.resetBasePositionAndOrientation(body, pose[:3], pose[3:], physicsClientId=self._world)

    def _add_cables(self, frame: Frame) -> list[int]:
        bodies = []
        for index, (cable, shape) in enumerate(zip(self._snapshot.scene.cables, frame.shapes, strict=True)):
            surface = tube(shape.nodes, 0.5 * cable.diameter, sides=16)
            color = CABLE_COLORS[index % len(CABLE_COLORS)]
            bodies += [self._add(piece, color) for piece in _pieces(surface)]
        return bodies

    def _clear_view(self, frame: Frame, aspect: float) -> View:
        """A view from which most of the cable is seen."""
        best = (-1.0, self._direction)
        for direction in (self._direction, *DIRECTIONS):
            share = self._visible_share(fit_view([frame], aspect=aspect, direction=direction), frame, aspect)
            best = max(best, (share, direction), key=lambda pair: pair[0])
            if share > VISIBLE_ENOUGH:
                break
        self._direction = best[1]
        return fit_view([frame], aspect=aspect, direction=best[1])

    def _visible_share(self, view: View, frame: Frame, aspect: float) -> float:
        """Share of the nodes of all cables that no solid hides."""
        width, height = int(PREVIEW * aspect), PREVIEW
        _, depth = self._render(view, width, height)
        nodes = np.concatenate([shape.nodes for shape in frame.shapes])
        column, row, ahead = view.pixels(nodes, width, height).T
        column, row = np.clip(column, 0, width - 1).astype(int), np.clip(row, 0, height - 1).astype(int)
        return float(np.mean(depth[row, column] > ahead - PREVIEW_DEPTH))

    def _render(self, view: View, width: int, height: int) -> tuple[Bytes, Floats]:
        """Colours (h, w, 3) and depths (h, w) [m] of the scene, before the light background."""
        bullet = self._bullet
        _, up, _ = view.axes()
        _, _, colors, depth, body = bullet.getCameraImage(
            width,
            height,
            bullet.computeViewMatrix(view.eye.tolist(), view.target.tolist(), up.tolist()),
            bullet.computeProjectionMatrixFOV(np.degrees(view.field_of_view), width / height, NEAR, FAR),
            shadow=1,
            lightDirection=LIGHT,
            lightDistance=4.0,
            lightAmbientCoeff=0.55,
            lightDiffuseCoeff=0.5,
            lightSpecularCoeff=0.1,
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self._world,
        )
        pixels = np.asarray(colors, dtype=np.uint8).reshape(height, width, 4)[:, :, :3].copy()
        empty = np.asarray(body).reshape(height, width) < 0
        pixels[empty] = np.broadcast_to(_background(height)[:, None, :], pixels.shape)[empty]
        ratio = np.asarray(depth, dtype=np.float64).reshape(height, width)
        return pixels, FAR * NEAR / (FAR - (FAR - NEAR) * ratio)


def _pieces(surface: Surface) -> list[Surface]:
    """The surface in parts that the renderer takes."""
    parts = []
    for start in range(0, len(surface.triangles), PIECE):
        used, triangles = np.unique(surface.triangles[start : start + PIECE], return_inverse=True)
        parts.append(Surface(surface.vertices[used], surface.normals[used], triangles.reshape(-1, 3)))
    return parts


def _background(height: int) -> Bytes:
    return np.linspace(*BACKGROUND, height).astype(np.uint8)  # (height, 3)


def _mark_contacts(picture: Image.Image, depth: Floats, view: View, frame: Frame, snapshot: Snapshot) -> None:
    """Dots at the contact points that no solid but the cable itself hides."""
    from PIL import ImageDraw

    pen = ImageDraw.Draw(picture)
    size = max(0.0045 * picture.height, 2.5 * OVERSAMPLING)
    diameters = np.array([cable.diameter for cable in snapshot.scene.cables])
    places = view.pixels(frame.touching.point, picture.width, picture.height)
    for (column, row, ahead), diameter in zip(places.tolist(), diameters[frame.touching.cable].tolist(), strict=True):
        if not (0 <= column < picture.width and 0 <= row < picture.height):
            continue
        if depth[int(row), int(column)] > ahead - 2.0 * diameter:
            box = (column - size, row - size, column + size, row + size)
            pen.ellipse(box, fill=CONTACT_COLOR, outline=(255, 255, 255), width=OVERSAMPLING)


def _write_caption(picture: Image.Image, frame: Frame) -> None:
    """A strip along the lower border: key posture and time at the left, numbers at the right."""
    from PIL import ImageDraw, ImageFont

    strip = max(18, picture.height // 18)
    top = picture.height - strip
    pen = ImageDraw.Draw(picture)
    pen.rectangle((0, top, picture.width, picture.height), fill=(38, 44, 52))
    font: Any = ImageFont.load_default(0.5 * strip)
    middle = top + 0.5 * strip
    pen.text((0.5 * strip, middle), frame.picture or frame.move, font=font, fill=(255, 255, 255), anchor="lm")
    pen.text((picture.width - 0.5 * strip, middle), numbers(frame), font=font, fill=(205, 212, 220), anchor="rm")


def numbers(frame: Frame) -> str:
    """Simulated time, number of contacts and largest tension of a frame, as one line; between two equilibria there are none."""
    if frame.relaxation:
        return f"t = {frame.time:.2f} s    artificial motion to the next equilibrium"
    count = len(frame.touching.s)
    tension = max((float(shape.tension.max(initial=0.0)) for shape in frame.shapes), default=0.0)
    return f"t = {frame.time:.2f} s    {count} contact{'' if count == 1 else 's'}    largest tension {tension:.2f} N"
