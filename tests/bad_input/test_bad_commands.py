"""Command lines with one mistake each: names, folders, settings."""

from __future__ import annotations

import pytest
from asking import Place


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("harnes_assembly",), "scene 'harnes_assembly' unknown; did you mean 'harness_assembly'? or give the path of a .toml file"),
        (("no.toml",), "no.toml: cannot be read (no such file or directory); give the path of a .toml file"),
        (("harness_assembly", "--set", "foo"), "--set 'foo' is no setting; give one such as cable.bending=0.01"),
        (("harness_assembly", "--set", "=3"), "--set '=3' is no setting; give one such as cable.bending=0.01"),
        (("harness_assembly", "--set", "cable.bendin=1"), "--set cables[0].bendin: unknown key; did you mean 'bending'?"),
        (("harness_assembly", "--set", "cabel.bending=1"), "--set cabel.bending: 'cabel' unknown; did you mean 'cable'?"),
        (("harness_assembly", "--set", "cables.9.length=3"), "--set cables.9.length: '9' unknown; there are 'trunk'"),
        (
            ("harness_assembly", "--set", "cable.bending=abc"),
            "--set cables[0].bending: 'abc' is not a stiffness; give a number in N m^2 or a string such as \"0.02 N m^2\"",
        ),
        (("harness_assembly", "--set", "gravity=0"), "--set gravity: 0 is not a list; give 3 numbers in m/s^2"),
        (("harness_assembly", "--set", "cable.length=nan"), "--set cables[0].length: nan m must be finite"),
        (
            ("harness_assembly", "--resolve", "no/scene.json"),
            "no/scene.json: cannot be written (No such file or directory); give another path",
        ),
    ],
)
def test_a_wrong_check_gets_one_sentence(arguments: tuple[str, ...], sentence: str, here: Place) -> None:
    assert here.refused("check", *arguments) == [sentence]


@pytest.mark.parametrize("out", ["full", "file", "file/run"])
def test_a_run_folder_that_cannot_be_used_is_refused_before_anything_starts(out: str, here: Place) -> None:
    (here.work / "full").mkdir()
    here.write("full/thesis.txt", "two years of work")
    here.write("file", "")
    lines = here.refused("run", "harness_assembly", "--out", out)

    assert len(lines) == 1
    assert lines[0].startswith(f"{out}: ")


@pytest.mark.parametrize("recording", [None, b"", b"no recording at all"])
def test_a_replay_of_what_is_no_run_is_refused(recording: bytes | None, here: Place) -> None:
    (here.work / "run").mkdir()
    if recording is not None:
        here.write("run/recording.msgpack", recording)
    lines = here.refused("replay", "run")

    assert len(lines) == 1
    assert "run" in lines[0]
    assert "mmap" not in lines[0]
    assert not lines[0].startswith("viz_client")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("rnu", "harness_assembly"), 'Unknown command "rnu". Did you mean "run"?'),
        (("run",), "requires an argument"),
        (("run", "harness_assembly", "more"), "more"),
        (("run", "harness_assembly", "--kernels", "fast"), 'Choose from: "auto", "compiled", "numpy"'),
        (("check", "harness_assembly", "--reslove", "x"), "--resolve"),
    ],
)
def test_a_command_line_that_is_no_command_says_what_there_is(arguments: tuple[str, ...], words: str, here: Place) -> None:
    shown = " ".join(" ".join(here.refused(*arguments)).replace("│", " ").split())

    assert words in shown
