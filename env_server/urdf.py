"""Robot descriptions: reading a URDF as float64, making the built-in dual-arm robot, and trying a foreign file out safely.

The file is read here and not through PyBullet, which rounds joint frames to float32. Read are links with their shapes and joints
with frames, axes and limits; transmissions, safety controllers and mimic couplings are left alone (every movable joint is free).
"""

from __future__ import annotations

import math
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from protocol.errors import SceneError

from .kinematics import FIXED, SLIDING, TURNING

CHECK_SECONDS: Final = 60.0
"""How long the trial load of a URDF may take; the largest robots in use take 9 s."""

SHOULDER_HEIGHT: Final = 1.06  # m
SHOULDER_OFFSET: Final = 0.22  # m, of each arm from the middle
SHOULDER_ROLL: Final = 0.4  # rad, outwards: with 1.57 only 18 of 24 grasps over a dashboard's lip are in reach, with 0.4 all
GRASP_OFFSET: Final = 0.105  # m, from the hand's flange to between the fingertips
KINDS: Final = {"fixed": FIXED, "revolute": TURNING, "continuous": TURNING, "prismatic": SLIDING}

TORSO: Final = """<link name="torso">
<inertial><origin xyz="0 0 0.4"/><mass value="60"/><inertia ixx="9" ixy="0" ixz="0" iyy="9" iyz="0" izz="3"/></inertial>
{shapes}</link>"""
TORSO_BOXES: Final = (  # edges, centre, then roll: m, m, rad
    ((0.50, 0.56, 0.16), (-0.06, 0.0, 0.08), 0.0),
    ((0.18, 0.20, 0.80), (-0.05, 0.0, 0.56), 0.0),
    ((0.16, 0.40, 0.12), (-0.05, 0.0, 0.97), 0.0),
    ((0.18, 0.18, 0.06), (-0.04, SHOULDER_OFFSET - 0.012, SHOULDER_HEIGHT - 0.029), -SHOULDER_ROLL),
    ((0.18, 0.18, 0.06), (-0.04, 0.012 - SHOULDER_OFFSET, SHOULDER_HEIGHT - 0.029), SHOULDER_ROLL),
)


@dataclass(frozen=True)
class Shape:
    """One visual or collision shape of a link."""

    link: str
    kind: str  # "mesh", "box", "cylinder" or "sphere"
    file: str  # of a mesh, as written; else empty
    size: tuple[float, ...]  # m; scale of a mesh, edges of a box, (radius, length) of a cylinder, (radius,) of a sphere
    origin: np.ndarray  # (4, 3) frame in the link: rotation in rows 0-2, position in row 3
    color: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Joint:
    """One joint, and the link that it carries."""

    name: str
    kind: int  # FIXED, TURNING or SLIDING
    parent: str
    child: str
    origin: np.ndarray  # (4, 3) frame in the parent link
    axis: np.ndarray  # (3,) unit, in the joint's frame
    lower: float  # rad or m; -inf without a limit
    upper: float  # rad or m
    effort: float  # N m or N; inf where the file names none


@dataclass(frozen=True)
class Description:
    """What a URDF says about links and joints; the joints are in an order in which parents come first."""

    root: str
    joints: tuple[Joint, ...]
    visuals: tuple[Shape, ...]
    collisions: tuple[Shape, ...]

    @property
    def links(self) -> tuple[str, ...]:
        """Names of all links, the root first."""
        return (self.root, *(joint.child for joint in self.joints))


def read_urdf(text: str, name: str) -> Description:
    """Read a URDF.

    Args:
        text: The XML.
        name: What to call the file in a sentence.

    Raises:
        SceneError: If it is no XML, has a joint of a kind that is not built, or is no tree.
    """
    try:
        root = ElementTree.fromstring(text)
        joints = [_read_joint(element) for element in root.findall("joint")]
        links = [_attribute(element, "name") for element in root.findall("link")]
        shapes = {
            tag: tuple(_read_shape(_attribute(link, "name"), shape) for link in root.findall("link") for shape in link.findall(tag))
            for tag in ("visual", "collision")
        }
    except (ElementTree.ParseError, ValueError) as error:
        raise SceneError(f"robot.model: '{name}' is not a URDF that can be read ({error}); give a valid one", key="robot.model") from error
    children = {joint.child for joint in joints}
    roots = [link for link in links if link not in children]
    if len(roots) != 1:
        raise SceneError(f"robot.model: '{name}' has {len(roots)} root links; a robot is one tree of links", key="robot.model")
    ordered, placed, waiting = [], {roots[0]}, joints
    while waiting:
        ready = [joint for joint in waiting if joint.parent in placed]
        if not ready:
            raise SceneError(
                f"robot.model: joint '{waiting[0].name}' in '{name}' hangs on '{waiting[0].parent}', which is not part of the tree",
                key="robot.model",
            )
        ordered.append(ready[0])
        placed.add(ready[0].child)
        waiting = [joint for joint in waiting if joint is not ready[0]]
    return Description(root=roots[0], joints=tuple(ordered), visuals=shapes["visual"], collisions=shapes["collision"])


def check_urdf(path: Path) -> None:
    """Load a URDF in a child process first: PyBullet ends the whole program on some files, which is no exception.

    Raises:
        SceneError: If the file is missing, cannot be loaded, ends the child or takes longer than `CHECK_SECONDS`.
    """
    if not path.is_file():
        raise SceneError(f"robot.model: '{path}' does not exist; give 'dual_panda' or the path of a URDF file", key="robot.model")
    program = "import sys, pybullet as p; p.connect(p.DIRECT); sys.exit(0 if p.loadURDF(sys.argv[1], useFixedBase=True) >= 0 else 3)"
    try:
        child = subprocess.run([sys.executable, "-P", "-c", program, str(path)], capture_output=True, timeout=CHECK_SECONDS, check=False)
    except subprocess.TimeoutExpired as error:
        raise SceneError(
            f"robot.model: loading '{path}' takes longer than {CHECK_SECONDS:g} s; give a lighter URDF", key="robot.model"
        ) from error
    if child.returncode < 0:
        raise SceneError(
            f"robot.model: '{path}' makes PyBullet crash (signal {-child.returncode}); give one that it can load", key="robot.model"
        )
    if child.returncode > 0:
        raise SceneError(f"robot.model: PyBullet cannot load '{path}'; give a valid URDF whose meshes exist", key="robot.model")


def dual_panda() -> str:
    """URDF of two Panda arms of pybullet_data on a torso of boxes; links of each arm start with "left_" or "right_"."""
    import pybullet_data

    folder = Path(pybullet_data.getDataPath()) / "franka_panda"
    source = (folder / "panda.urdf").read_text(encoding="utf-8")
    boxes = "\n".join(
        f'<{tag}><origin xyz="{x} {y} {z}" rpy="{roll} 0 0"/><geometry><box size="{a} {b} {c}"/></geometry></{tag}>'
        for tag in ("visual", "collision")
        for (a, b, c), (x, y, z), roll in TORSO_BOXES
    )
    parts = [TORSO.format(shapes=boxes)]
    for arm, side in (("left", 1.0), ("right", -1.0)):
        panda = ElementTree.fromstring(source)
        for element in panda.iter():
            _rename(element, arm, folder)
        if side < 0.0:
            _turn_grasp(panda, f"{arm}_grasp_joint")
        parts += [ElementTree.tostring(child, encoding="unicode") for child in panda if child.tag in ("link", "joint")]
        roll = -side * SHOULDER_ROLL
        parts.append(
            f'<joint name="{arm}_mount" type="fixed"><parent link="torso"/><child link="{arm}_link0"/>'
            f'<origin xyz="0 {side * SHOULDER_OFFSET} {SHOULDER_HEIGHT}" rpy="{roll} 0 0"/></joint>'
        )
    return '<?xml version="1.0"?>\n<robot name="dual_panda">\n' + "\n".join(parts) + "\n</robot>\n"


def _turn_grasp(panda: ElementTree.Element, name: str) -> None:
    """Turn the right arm's grasp frame by half a turn about its z, so that a cable laid from left to right suits both arms alike.

    The gripper is the same either way round, but the last joint is not: without this its range is used up on one side.
    """
    for joint in panda.findall("joint"):
        if joint.get("name") == name:
            joint.find("origin").set("rpy", f"0 0 {math.pi!r}")  # type: ignore[union-attr]


def _rename(element: ElementTree.Element, arm: str, folder: Path) -> None:
    """Give one element of the single arm its place in the pair: names, mesh files; `grasptarget` becomes the grasp link."""
    for key in ("name", "link", "joint"):
        value = element.get(key)
        if value is not None and value.startswith("panda_") and element.tag != "material":
            own = value.removeprefix("panda_").replace("grasptarget_hand", "grasp_joint").replace("grasptarget", "grasp")
            element.set(key, f"{arm}_{own}")
    file = element.get("filename")
    if file is not None:
        element.set("filename", str(folder / file.removeprefix("package://")))


def _read_joint(element: ElementTree.Element) -> Joint:
    name, kind = _attribute(element, "name"), _attribute(element, "type")
    if kind not in KINDS:
        raise ValueError(f"joint '{name}' is of type '{kind}'; there are {', '.join(KINDS)}")
    axis_element, limit = element.find("axis"), element.find("limit")
    axis = _numbers(axis_element.get("xyz", "1 0 0"), 3) if axis_element is not None else np.array([1.0, 0.0, 0.0])
    size = float(np.linalg.norm(axis))
    if KINDS[kind] != FIXED and not size > 1e-9:
        raise ValueError(f"joint '{name}' has an axis without direction")
    lower, upper = -math.inf, math.inf
    if limit is not None and kind in ("revolute", "prismatic"):
        lower, upper = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
    if lower > upper:
        raise ValueError(f"joint '{name}' has its lower limit {lower:g} above its upper limit {upper:g}")
    effort = float(limit.get("effort", "0")) if limit is not None else 0.0
    return Joint(
        name=name,
        kind=KINDS[kind],
        parent=_linked(element, "parent"),
        child=_linked(element, "child"),
        origin=_origin(element.find("origin")),
        axis=axis / size if size > 0 else axis,
        lower=lower,
        upper=upper,
        effort=effort if effort > 0 else math.inf,
    )


def _read_shape(link: str, element: ElementTree.Element) -> Shape:
    geometry = element.find("geometry")
    form = geometry[0] if geometry is not None and len(geometry) else None
    if form is None or form.tag not in ("mesh", "box", "cylinder", "sphere", "capsule"):
        raise ValueError(f"a shape of link '{link}' is neither mesh, box, cylinder nor sphere")
    size: tuple[float, ...]
    match form.tag:
        case "mesh":
            size = tuple(_numbers(form.get("scale", "1 1 1"), 3))
        case "box":
            size = tuple(_numbers(_attribute(form, "size"), 3))
        case "sphere":
            size = (float(_attribute(form, "radius")),)
        case _:
            size = (float(_attribute(form, "radius")), float(_attribute(form, "length")))
    color = element.find("material/color")
    rgb = _numbers(_attribute(color, "rgba"), 4)[:3].tolist() if color is not None else None
    return Shape(
        link=link,
        kind=form.tag,
        file=form.get("filename", ""),
        size=size,
        origin=_origin(element.find("origin")),
        color=None if rgb is None else (rgb[0], rgb[1], rgb[2]),
    )


def _origin(element: ElementTree.Element | None) -> np.ndarray:
    """Frame (4, 3) of an origin: rpy turns about the fixed axes x, y, z in this order."""
    frame = np.zeros((4, 3))
    if element is None:
        frame[:3] = np.eye(3)
        return frame
    (cr, cp, cy), (sr, sp, sy) = (f(_numbers(element.get("rpy", "0 0 0"), 3)) for f in (np.cos, np.sin))
    frame[0] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    frame[1] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    frame[2] = -sp, cp * sr, cp * cr
    frame[3] = _numbers(element.get("xyz", "0 0 0"), 3)
    return frame


def _numbers(text: str, count: int) -> np.ndarray:
    values = np.array([float(word) for word in text.split()])
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(f"'{text}' must be {count} finite numbers")
    return values


def _attribute(element: ElementTree.Element, key: str) -> str:
    value = element.get(key)
    if value is None:
        raise ValueError(f"<{element.tag}> lacks '{key}'")
    return value


def _linked(element: ElementTree.Element, tag: str) -> str:
    found = element.find(tag)
    if found is None:
        raise ValueError(f"joint '{element.get('name')}' lacks <{tag}>")
    return _attribute(found, "link")
