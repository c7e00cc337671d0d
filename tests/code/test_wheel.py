"""What is installed is all that is needed: every package, every scene, the licence, the command."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rooms import ROOMS, ROOT, files

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SETUPTOOLS_LEAST = 77  # as pyproject.toml asks; an older one cannot read the licence there


def test_the_packages_named_are_the_folders_that_exist() -> None:
    assert sorted(PROJECT["tool"]["setuptools"]["packages"]) == sorted({str(path.parent).replace("/", ".") for path in files()})


def test_every_file_that_is_no_code_is_named() -> None:
    data = {f"{room}/{pattern}" for room, patterns in PROJECT["tool"]["setuptools"]["package-data"].items() for pattern in patterns}
    other = {
        path.relative_to(ROOT)
        for room in ROOMS
        for path in (ROOT / room).rglob("*")
        if path.is_file() and path.suffix not in (".py", ".pyc")
    }
    other = {path for path in other if "__pycache__" not in path.parts}
    assert other
    assert {str(path) for path in other if not any(path.match(pattern) for pattern in data)} == set()


def test_the_command_exists() -> None:
    module, _, name = PROJECT["project"]["scripts"]["cablecosim"].partition(":")
    assert f"def {name}(" in (ROOT / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8")


def test_the_wheel_contains_every_package_every_scene_and_the_licence(tmp_path: Path) -> None:
    names = wheel_names(tmp_path)
    assert {str(path) for path in files()} <= names
    assert {str(path.relative_to(ROOT)) for path in (ROOT / "scenarios").glob("*.toml")} <= names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not [name for name in names if name.startswith("tests")]


def wheel_names(folder: Path) -> set[str]:
    """Names in a wheel made from a copy of the sources; as pyproject.toml has them where no build backend is installed."""
    source = folder / "source"
    for room in ROOMS:
        shutil.copytree(ROOT / room, source / room, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    if not has_backend():
        return named_in_pyproject(source)
    command = [sys.executable, "-m", "pip", "wheel", ".", "--no-deps", "--no-build-isolation", "--no-index", "-w", str(folder)]
    run = subprocess.run(command, cwd=source, capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def has_backend() -> bool:
    """Whether a setuptools is installed that can read our pyproject.toml."""
    try:
        return int(version("setuptools").split(".")[0]) >= SETUPTOOLS_LEAST
    except PackageNotFoundError:
        return False


def named_in_pyproject(source: Path) -> set[str]:
    """Files that the build would take."""
    tool, project = PROJECT["tool"]["setuptools"], PROJECT["project"]
    taken = [path for package in tool["packages"] for path in (source / package.replace(".", "/")).glob("*.py")]
    taken += [
        path for package, patterns in tool["package-data"].items() for pattern in patterns for path in (source / package).glob(pattern)
    ]
    licences = {f"{project['name']}-{project['version']}.dist-info/licenses/{name}" for name in project["license-files"]}
    return {str(path.relative_to(source)) for path in taken} | licences
