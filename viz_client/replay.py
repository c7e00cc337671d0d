"""A page that replays a run: one HTML file that opens offline, with a time slider, play and a camera to be moved.

viser writes the page: every change of its scene becomes a message with a time, and its own client plays them back. What
stands still is sent once, what moves is sent when it has moved. The cable is a tube of fixed triangles whose vertices are
replaced (a skinned mesh costs a message a bone and is six times as slow). The server that viser needs for this listens on
127.0.0.1 only, on a free port, while the page is being written.
"""

from __future__ import annotations

import contextlib
import html
import io
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from protocol import recording
from protocol.messages import Frame, Snapshot
from protocol.recording import Frames, Recording

from .picture import CABLE_COLORS, CONTACT_COLOR, numbers
from .surface import Floats, smoothed
from .tube import resampled, tube, tube_triangles
from .view import fit_view

FRAMES_MAX: Final = 500
CAMERA: Final = (0.95, 0.6)  # rad, see `fit_view`: past the robot, from behind its right shoulder
LABEL_HEIGHT: Final = 0.12  # m, above the highest point that any cable reaches
POSTURE_SHOWN: Final = 1.0  # s of simulated time that a key posture's name stays
OVERLAY_STYLE: Final = (
    "position:fixed;right:12px;top:12px;max-width:28vw;z-index:1;padding:8px 12px;border-radius:6px;pointer-events:none;"
    "background:rgba(255,255,255,.85);color:#262c34;font:12px/1.4 system-ui,sans-serif"
)
NODES: Final = 100  # of a drawn cable
SIDES: Final = 8  # of a drawn cable
STILL: Final = 1e-5  # m and unit quaternion; less is no motion to the eye
GRID: Final = 2.0**-15  # m, 0.03 mm: cable vertices are rounded to it, which halves their size when packed
LAST_FRAME: Final = 1.0  # s that the last frame is shown before the replay starts again


def write_replay(
    recording_path: Path,
    html_path: Path,
    *,
    frames_max: int = FRAMES_MAX,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> int:
    """Write the page from a recording, complete or not.

    Args:
        recording_path: See `protocol.recording`.
        html_path: File to write; an existing one is replaced.
        frames_max: A longer run is thinned to this many frames, the first and the last among them, and the key postures.
        progress: Called with the number of frames done and their total.

    Returns:
        Number of frames in the page; 0 if the recording holds none, and then no page is written.

    Raises:
        RecordingError: If the recording has no readable beginning.
    """
    run = recording.read(recording_path)
    chosen = _chosen(run.frames, frames_max)
    if not chosen:
        return 0
    shown = [run.frames[index] for index in chosen]
    with _server() as server:
        actors = _build(server, run.snapshot, shown)
        serializer = server.get_scene_serializer()
        time = shown[0].time
        for done, frame in enumerate(shown, start=1):
            serializer.insert_sleep(max(0.0, frame.time - time))
            time = frame.time
            for actor in actors:
                actor(frame)
            progress(done, len(shown))
        serializer.insert_sleep(LAST_FRAME)
        page = serializer.as_html()
    html_path.write_text(_with_title(page, run, shown), encoding="utf-8")
    return len(shown)


Actor = Callable[[Frame], None]
"""Brings its part of the scene to where it is in a frame."""


@contextlib.contextmanager
def _server() -> Iterator[Any]:
    """A viser server for as long as the page is written."""
    import viser

    with contextlib.redirect_stdout(io.StringIO()):  # viser tells where it listens and that it stops, asked or not
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def _build(server: Any, snapshot: Snapshot, frames: list[Frame]) -> list[Actor]:
    """Set up what stands still and the pose of the first frame; returns what moves the rest."""
    first = frames[0]
    view = fit_view(frames, aspect=1.6, direction=CAMERA)
    camera = server.initial_camera
    camera.position, camera.look_at, camera.up, camera.fov = view.eye, view.target, (0.0, 0.0, 1.0), view.field_of_view
    server.scene.set_up_direction("+z")
    server.scene.add_grid("/floor", width=4.0, height=4.0, cell_size=0.25, section_size=1.0, plane_opacity=0.0)
    actors = [_solid(server, index, snapshot, first) for index in range(len(snapshot.solids))]
    actors += [_cable(server, index, snapshot, first) for index in range(len(snapshot.scene.cables))]
    highest = max(float(shape.nodes[:, 2].max()) for frame in frames for shape in frame.shapes)
    label_place = (float(view.target[0]), float(view.target[1]), highest + LABEL_HEIGHT)
    thickest = max(cable.diameter for cable in snapshot.scene.cables)
    return [*actors, _contacts(server, thickest, first), _label(server, label_place, first)]


def _solid(server: Any, index: int, snapshot: Snapshot, first: Frame) -> Actor:
    solid = snapshot.solids[index]
    surface = smoothed(solid.vertices, solid.triangles)
    shown = first.poses[index]
    mesh = server.scene.add_mesh_simple(
        f"/solids/{index}_{solid.name.replace('/', '_')}",
        surface.vertices.astype(np.float32),
        surface.triangles.astype(np.uint32),
        color=solid.color,
        side="double",
        position=shown[:3],
        wxyz=shown[[6, 3, 4, 5]],
    )

    def act(frame: Frame) -> None:
        nonlocal shown
        pose = frame.poses[index]
        if np.abs(pose[:3] - shown[:3]).max() > STILL:
            mesh.position = pose[:3]
        if np.abs(pose[3:] - shown[3:]).max() > STILL:
            mesh.wxyz = pose[[6, 3, 4, 5]]
        shown = np.where(np.abs(pose - shown) > STILL, pose, shown)

    return act


def _cable(server: Any, index: int, snapshot: Snapshot, first: Frame) -> Actor:
    cable = snapshot.scene.cables[index]

    def vertices(frame: Frame) -> Floats:
        surface = tube(resampled(frame.shapes[index].nodes, NODES), 0.5 * cable.diameter, sides=SIDES)
        return np.asarray(np.round(surface.vertices / GRID) * GRID, dtype=np.float32)

    color = CABLE_COLORS[index % len(CABLE_COLORS)]
    triangles = tube_triangles(NODES, SIDES).astype(np.uint32)
    mesh = server.scene.add_mesh_simple(f"/cables/{index}", vertices(first), triangles, color=color)

    def act(frame: Frame) -> None:
        mesh.vertices = vertices(frame)

    return act


def _contacts(server: Any, size: float, first: Frame) -> Actor:
    """Discs at the contact points, wider than the cable that would hide them."""
    shown = first.touching.point
    cloud = server.scene.add_point_cloud(
        "/contacts", shown.astype(np.float32), CONTACT_COLOR, point_size=size, point_shape="circle", precision="float32"
    )

    def act(frame: Frame) -> None:
        nonlocal shown
        if not np.array_equal(frame.touching.point, shown):
            cloud.points = frame.touching.point.astype(np.float32)
            shown = frame.touching.point

    return act


def _label(server: Any, place: tuple[float, float, float], first: Frame) -> Actor:
    """A line of text above the cable: what is being done, and for a while the key posture just reached."""
    label = server.scene.add_label("/label", _caption(first.picture or first.move, first), position=place, anchor="bottom-center")
    posture, until = first.picture, first.time + POSTURE_SHOWN

    def act(frame: Frame) -> None:
        nonlocal posture, until
        if frame.picture:
            posture, until = frame.picture, frame.time + POSTURE_SHOWN
        label.text = _caption(posture if posture and frame.time < until else frame.move, frame)

    return act


def _caption(name: str, frame: Frame) -> str:
    return f"{name}   |   {numbers(frame)}"


def _chosen(frames: Frames, frames_max: int) -> list[int]:
    """Indices of the frames to show: evenly thinned, with every key posture and the last."""
    even = {round(index) for index in np.linspace(0, len(frames) - 1, min(len(frames), frames_max)).tolist()}
    return [index for index, frame in enumerate(frames) if index in even or frame.picture]


def _with_title(page: str, run: Recording, chosen: list[Frame]) -> str:
    """The page with the scene's title, and a list of its key postures with their times."""
    title = html.escape(run.snapshot.scene.title)
    ending = "" if run.complete else f" ({html.escape(run.ending)})"
    postures = "".join(f"<li>{frame.time:.2f} s &ensp;{html.escape(frame.picture)}</li>" for frame in chosen if frame.picture)
    overlay = (
        f'<div style="{OVERLAY_STYLE}"><b>{title}</b>{ending}<ul style="margin:4px 0 0;padding:0;list-style:none">{postures}</ul></div>'
    )
    page = re.sub(r"<title>.*?</title>", lambda _: f"<title>{title}</title>", page, count=1, flags=re.DOTALL)
    return page.replace("</body>", f"{overlay}</body>", 1)
