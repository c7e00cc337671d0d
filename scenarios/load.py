"""Scenes by name or by file: read, overridden, checked, and written out for the programs."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Final

from protocol.errors import CablecosimError, SceneError
from protocol.scene import Body, Robot, Scene, check_scene

from .document import Document, read_text
from .lines import Path as KeyPath
from .lines import key_path
from .quantity import Mistake
from .spelling import meant

GENERATED: Final = ("dashboard", "beam")  # bodies that env_server can generate
FOLDERS: Final = ("", "paper/")  # of the scenes that come with the project
ROBOTS: Final = ("dual_panda",)  # robots that env_server can build


def load(name_or_path: str | Path, overrides: Sequence[str] = ()) -> Scene:
    """A built-in scene by name, or the scene in a TOML file; checked, with absolute paths.

    Args:
        name_or_path: Such as "harness_assembly" or "my_scene.toml".
        overrides: Such as "cable.bending=0.01", "cables.trunk.diameter=9 mm" or "time_step=0.01".

    Raises:
        SceneError: Holds one sentence for every mistake, each on a line of its own.
    """
    name, text, folder = _open(str(name_or_path))
    document = Document(name, text, overrides)
    scene = document.read(Scene, lambda scene: [*_files(scene, folder), *_relations(scene)])
    return _absolute(scene, folder)


def built_in() -> list[str]:
    """Names of the scenes that come with the project; those of the paper's figures begin with their folder, "paper/"."""
    ours = resources.files(__package__)
    found = ((folder, entry.name) for folder in FOLDERS for entry in (ours / folder).iterdir())
    return sorted(f"{folder}{name.removesuffix('.toml')}" for folder, name in found if name.endswith(".toml"))


def title(name: str) -> str:
    """Title of a built-in scene, without checking the rest of it."""
    return str(tomllib.loads(_open(name)[1])["title"])


def scene_name(name_or_path: str | Path) -> str:
    """Short name of a scene, for the folder of its runs."""
    return Path(name_or_path).name.removesuffix(".toml")


def write_resolved(scene: Scene, path: Path) -> None:
    """Write a scene as the programs read it: SI units, every default filled in."""
    from protocol import scene_file

    try:
        path.write_bytes(scene_file.write(scene))
    except OSError as error:
        raise CablecosimError(f"{path}: cannot be written ({error.strerror}); give another path", key=str(path)) from error


def _open(name_or_path: str) -> tuple[str, str, Path]:
    """Name to show, text, and the folder that relative paths start from."""
    if name_or_path in built_in():
        file = resources.files(__package__) / f"{name_or_path}.toml"
        return file.name, file.read_text(encoding="utf-8"), Path(str(file)).parent
    path = Path(name_or_path)
    if not (path.suffix == ".toml" or path.exists() or path.parent != Path()):
        close = meant(name_or_path, built_in())
        own = ", ".join(repr(name) for name in built_in() if "/" not in name)
        choice = f"did you mean '{close}'?" if close else f"there are {own} and the paper's figures, see `cablecosim list`,"
        raise SceneError(f"scene '{name_or_path}' unknown; {choice} or give the path of a .toml file", key=name_or_path)
    return name_or_path, read_text(path), path.resolve().parent


def _relations(scene: Scene) -> Iterator[Mistake]:
    """What `check_scene` finds, with the key apart from the sentence."""
    try:
        check_scene(scene)
    except SceneError as error:
        yield Mistake(key_path(error.key), str(error).removeprefix(error.key).removeprefix(": "))


def _files(scene: Scene, folder: Path) -> Iterator[Mistake]:
    """Bodies and robots that are neither built in nor files."""
    for index, body in enumerate(scene.bodies):
        if body.generate is not None and body.generate not in GENERATED:
            names = ", ".join(repr(name) for name in GENERATED)
            yield Mistake(("bodies", index, "generate"), f"'{body.generate}' unknown; there are {names}")
        if body.mesh is not None:
            yield from _file(("bodies", index, "mesh"), body.mesh, folder, "a mesh file such as part.stl")
    if scene.robot is not None and scene.robot.model not in ROBOTS:
        if not scene.robot.model.endswith(".urdf"):
            yield Mistake(("robot", "model"), f"'{scene.robot.model}' unknown; there is 'dual_panda', or give a .urdf file")
        else:
            yield from _file(("robot", "model"), scene.robot.model, folder, "a .urdf file")


def _file(path: KeyPath, name: str, folder: Path, wanted: str) -> Iterator[Mistake]:
    file = folder / name
    if not file.is_file():
        yield Mistake(path, f"'{name}' does not exist as {file}; give {wanted}, relative to the scene file")
    elif file.stat().st_size == 0:
        yield Mistake(path, f"'{name}' is an empty file; give {wanted}")


def _absolute(scene: Scene, folder: Path) -> Scene:
    """The same scene with the paths of its meshes and its URDF absolute."""

    def moved(body: Body) -> Body:
        return body if body.mesh is None else replace(body, mesh=str((folder / body.mesh).resolve()))

    robot: Robot | None = scene.robot
    if robot is not None and robot.model not in ROBOTS:
        robot = replace(robot, model=str((folder / robot.model).resolve()))
    return replace(scene, bodies=tuple(moved(body) for body in scene.bodies), robot=robot)
