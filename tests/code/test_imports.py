"""Who imports whom, and what is not loaded by those who do not need it."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from rooms import PROGRAMS, ROOMS, ROOT, files, importers, imports, tree

ONLY_IN = {
    "zmq": {"protocol/channel.py", "protocol/sockets.py"},
    "msgpack": {"protocol/recording.py"},
    "pybullet": {"env_server/world.py", "viz_client/picture.py", "viz_client/painter.py"},  # the last only loads it ahead of time
    "pybullet_data": {"env_server/urdf.py"},
    "trimesh": {"env_server/meshes.py"},
    "manifold3d": {"env_server/dashboard.py"},
    "viser": {"viz_client/replay.py"},
    "PIL": {"viz_client/picture.py"},
    "matplotlib": {"viz_client/chart.py"},
    "cabledyn": {"shape_server/accuracy/peers/peer_cabledyn.py"},
    "moorpy": {"shape_server/accuracy/peers/peer_moorpy.py"},
    "mujoco": {"shape_server/accuracy/peers/peer_mujoco.py"},
    "elastica": {"shape_server/accuracy/peers/peer_pyelastica.py"},
}
"""Files that may import a library: one or two each, so that another could take its place."""

ONLY_IN_ROOM = {
    "pydantic": {"scenarios"},
    "pint": {"scenarios"},
    "cyclopts": {"scenarios"},
    "rich": {"scenarios"},
    "numba": {"shape_server", "env_server"},
    "scipy": {"shape_server", "env_server", "viz_client"},
    "annotated_types": {"protocol", "scenarios"},
}

NOT_LOADED = {
    # Program, or module of it: what importing it must not load.
    "protocol.messages": {
        "zmq",
        "pybullet",
        "trimesh",
        "viser",
        "pydantic",
        "pint",
        "numba",
        "scipy",
        "rich",
        "cyclopts",
        "PIL",
        "msgpack",
    },
    "shape_server": {"zmq", "pybullet", "trimesh", "viser", "pydantic", "pint", "rich", "cyclopts", "PIL", "manifold3d"},
    "shape_server.__main__": {"pybullet", "trimesh", "viser", "pydantic", "pint", "rich", "cyclopts", "PIL", "manifold3d"},
    "env_server.__main__": {"pybullet", "trimesh", "viser", "pydantic", "pint", "rich", "cyclopts", "PIL", "manifold3d"},
    "viz_client.__main__": {"pybullet", "trimesh", "viser", "pydantic", "pint", "rich", "cyclopts", "numba", "manifold3d"},
    "scenarios": {"zmq", "pybullet", "trimesh", "viser", "numba", "pint", "PIL", "manifold3d"},
    "scenarios.cli": {"zmq", "pybullet", "trimesh", "viser", "numba", "pint", "pydantic", "PIL", "manifold3d"},
}


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_imports_no_other_program(program: str) -> None:
    others = set(PROGRAMS) - {program}
    for path in files(program):
        assert not {name.split(".")[0] for name in imports(path)} & others, path


def test_the_vocabulary_imports_nothing_of_ours() -> None:
    for path in files("protocol"):
        assert not {name.split(".")[0] for name in imports(path)} & set(ROOMS), path


def test_no_source_imports_the_tests() -> None:
    for path in files():
        assert "tests" not in {name.split(".")[0] for name in imports(path)}, path


@pytest.mark.parametrize("library", ONLY_IN)
def test_a_foreign_library_is_imported_where_it_belongs_and_nowhere_else(library: str) -> None:
    assert importers(library) == ONLY_IN[library]


@pytest.mark.parametrize("library", ONLY_IN_ROOM)
def test_a_foreign_library_stays_in_its_rooms(library: str) -> None:
    assert {Path(path).parts[0] for path in importers(library)} <= ONLY_IN_ROOM[library]


def test_programs_make_changed_copies_of_messages_and_know_nothing_else_of_the_codec() -> None:
    assert importers("msgspec", "protocol") == {
        "protocol/checkpoint.py",
        "protocol/codec.py",
        "protocol/messages.py",
        "protocol/part.py",
        "protocol/scene_file.py",
        "protocol/skeleton.py",
    }
    for path in importers("msgspec", *PROGRAMS):
        used = {ast.unparse(node) for node in ast.walk(tree(Path(path))) if isinstance(node, ast.Attribute)}
        assert {name for name in used if name.startswith("msgspec")} == {"msgspec.structs", "msgspec.structs.replace"}, path


def test_every_foreign_library_is_a_dependency() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {line.split(">")[0].strip() for line in project["dependencies"]}
    peers = {"cabledyn", "moorpy", "mujoco", "elastica"}  # compared with where they are installed: of the extra `bench`
    named = {"zmq": "pyzmq", "PIL": "pillow", "pybullet_data": "pybullet", "annotated_types": "annotated-types"}
    used = {name.split(".")[0] for path in files() for name in imports(path)} - set(sys.stdlib_module_names) - set(ROOMS) - peers
    assert {named.get(name, name) for name in used} == declared


@pytest.mark.parametrize("module", NOT_LOADED)
def test_importing_a_program_loads_nothing_that_only_some_scenes_need(module: str) -> None:
    code = f"import sys, {module}; print(*{{name.split('.')[0] for name in sys.modules}})"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120, check=True)
    assert not NOT_LOADED[module] & set(run.stdout.split())


def test_only_the_ends_of_a_program_touch_a_channel() -> None:
    ends = {
        "env_server/__main__.py", "env_server/asking.py", "env_server/control.py", "env_server/outlet.py", "env_server/server.py",
        "shape_server/server.py",
        "viz_client/client.py", "scenarios/launch.py", "scenarios/remote.py",
    }  # fmt: skip
    assert {str(path) for path in files(*PROGRAMS) if any(name.startswith("protocol.channel") for name in imports(path))} <= ends


def test_nobody_reaches_into_the_private_parts_of_another_file() -> None:
    for path in files():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ImportFrom):
                assert not [alias.name for alias in node.names if alias.name.startswith("_")], path
