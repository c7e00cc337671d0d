"""The command `cablecosim`. Exit codes: 0 well, 1 ended otherwise than asked for, 2 bad input, 130 interrupted.

Only what the command line itself needs is imported here; each command imports the rest, so that `--help` answers at once.
"""

from __future__ import annotations

import json
import signal
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter
from rich.console import Console

from protocol.errors import CablecosimError

Settings = Annotated[
    list[str] | None,
    Parameter(
        name="--set", negative=(), help="Override a value, such as cable.bending=0.01 or cables.trunk.diameter='9 mm'; may be given again."
    ),
]
SceneName = Annotated[str, Parameter(help="A built-in scene (see `cablecosim list`) or the path of a .toml file.")]

STUDIED = ("harness_assembly", "case_study_1")  # scenes of the standard set of `accuracy`

app = App("cablecosim", help="Simulate a robot assembling a cable harness.", version=lambda: f"cablecosim {version('cablecosim')}")


def main() -> None:
    """Run the command line; never ends in a traceback for a mistake of the user's."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # asked to end is interrupted: children end in good order
    try:
        app()
    except CablecosimError as error:
        _say(str(error))
        sys.exit(2)
    except KeyboardInterrupt:
        _say("interrupted")
        sys.exit(130)


@app.command
def run(
    scene: SceneName,
    /,
    *,
    settings: Settings = None,
    out: Annotated[Path | None, Parameter(help="The run folder; runs/SCENE-TIME unless given.")] = None,
    replay: Annotated[bool, Parameter(help="Write replay.html and report.html.")] = True,
    kernels: Annotated[
        Literal["auto", "compiled", "numpy"],
        Parameter(help="Solve by compiled kernels, by numpy, or (auto) by numpy until the kernels are compiled."),
    ] = "auto",
    keys: Annotated[Path | None, Parameter(help="Encrypt everything with the keys of this folder; see `cablecosim keys`.")] = None,
) -> int:
    """Run a scene in three processes; write a recording, pictures, a report, a replay page and a summary."""
    from . import summary
    from .launch import launch
    from .load import load, scene_name
    from .progress import display

    loaded = load(scene, settings or ())
    ended = launch(loaded, scene_name(scene), display(), out=out, kernels=kernels, replay=replay, keys=keys)
    Console().print(summary.table(ended.summary))
    Console().print(f"written to {ended.folder}" + ("; open report.html there" if replay else ""), markup=False, soft_wrap=True)
    if ended.interrupted:
        return 130
    if not ended.summary["complete"]:
        _say(ended.summary["sentence"])
    return int(not ended.summary["complete"])


@app.command
def keys(folder: Annotated[Path, Parameter(help="A new folder, for you alone.")], /) -> int:
    """Make keys, so that programs on other machines may talk to each other, and nobody else to them.

    Give the folder to every program with --keys; an address may then be one that others can reach. Another machine gets a copy of
    the folder; or keys of its own, from which its client.pub goes into known/ here, and server.pub from here takes the place of its own.
    """
    from protocol.keys import make
    from protocol.sockets import key_pair

    make(folder, key_pair)
    Console().print(f"written to {folder}: keep server.key and client.key secret", markup=False, soft_wrap=True)
    return 0


@app.command
def replay(run: Annotated[Path, Parameter(help="Folder of a run.")], /) -> int:
    """Write pictures, replay.html and report.html of a run anew, from its recording."""
    import subprocess

    from protocol import recording

    from .children import REFUSED, command, environment, refusal

    if not (run / recording.FILE_NAME).is_file():
        raise CablecosimError(f"{run}: holds no {recording.FILE_NAME}; give the folder of a run", key=str(run))
    done = subprocess.run(command("viz_client", ("--redraw", str(run))), env=environment(), check=False, stderr=subprocess.PIPE, text=True)
    if done.returncode == REFUSED:
        raise CablecosimError(refusal("viz_client", done.stderr.strip()), key=str(run))
    sys.stderr.write(done.stderr)
    return done.returncode if done.returncode >= 0 else 1


@app.command(name="list")
def list_scenes() -> int:
    """List the built-in scenes."""
    from .load import built_in, title

    for name in built_in():
        Console().print(f"{name}  {title(name)}", markup=False, highlight=False, soft_wrap=True)
    return 0


@app.command
def check(
    scene: SceneName,
    /,
    *,
    settings: Settings = None,
    resolve: Annotated[Path | None, Parameter(help="Write the scene as JSON in SI units, every default filled in.")] = None,
) -> int:
    """Say everything that is wrong with a scene, or nothing but what it holds."""
    from .load import load, write_resolved

    loaded = load(scene, settings or ())
    if resolve is not None:
        write_resolved(loaded, resolve)
    counts = {"cable": loaded.cables, "gripper": loaded.grippers, "body": loaded.bodies, "move": loaded.moves, "picture": loaded.pictures}
    parts = ", ".join(f"{len(items)} {_plural(word, len(items))}" for word, items in counts.items() if items)
    line = f"{scene}: correct; {parts}; {sum(move.duration for move in loaded.moves):g} s in steps of {loaded.time_step:g} s"
    Console().print(line, markup=False, highlight=False, soft_wrap=True)
    return 0


@app.command
def schema() -> int:
    """Print the JSON Schema of scene files, for editors; docs/scenes.md says the same in words."""
    from . import schema as made

    sys.stdout.write(json.dumps(made.schema(), indent=2) + "\n")
    return 0


@app.command
def shape(
    posture: Annotated[Path, Parameter(help="A TOML file with a cable, its grasps and contacts.")],
    /,
    *,
    settings: Settings = None,
) -> int:
    """Predict the shape of one cable in one posture; print it as JSON."""
    from protocol.kinds import Outcome

    from .ask import as_json, ask
    from .posture import load_posture

    asked = load_posture(posture, settings or ())
    answer = ask(asked)
    sys.stdout.write(json.dumps(as_json(asked, answer)) + "\n")
    if answer.outcome is not Outcome.CONVERGED:
        _say(answer.sentence)
    return int(answer.outcome is not Outcome.CONVERGED)


@app.command
def calibrate(
    points: Annotated[Path, Parameter(help="Comma-separated values: a line of names, such as x [mm], y [mm], z [mm], then the points.")],
    posture: Annotated[Path, Parameter(help="A posture file: the cable with first guesses, and how it was held and loaded.")],
    /,
    *,
    fit: Annotated[
        tuple[Literal["bending", "twist", "mass_per_length", "micro_length"], ...],
        Parameter(negative=(), help="Fit this number, and no other; may be given again. Unless given: what the points determine."),
    ] = (),
    json_file: Annotated[Path | None, Parameter(name="--json", help="Write intervals, deviations and the fitted shape.")] = None,
    settings: Settings = None,
) -> int:
    """Fit a cable's stiffness to measured points of its shape; say how well each number is determined."""
    from protocol.codec import encode

    from .children import run_to_its_end
    from .posture import load_posture

    request = load_posture(posture, settings or ()).request()
    words = [str(points), *(["--fit", *fit] if fit else []), *(["--json", str(json_file)] if json_file is not None else [])]
    return run_to_its_end("shape_server.calibration", words, encode(request))


@app.command
def hardcases(
    *,
    family: Annotated[str | None, Parameter(help="Run one family only.")] = None,
    list_cases: Annotated[bool, Parameter(name="--list", negative=(), help="Name every case with its family, and end.")] = False,
    json_file: Annotated[Path | None, Parameter(name="--json", help="Write every case with its ending, error, time and sentence.")] = None,
    kernels: Annotated[Literal["auto", "compiled", "numpy"], Parameter(help="Solve by compiled kernels if ready, or as named.")] = "auto",
    peers: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=(), help="Ask others too; all unless named.")] = None,
) -> int:
    """Solve a catalogue of hard cases; print how they end, family by family. Exit code 1 if one is wrong that was not known to be."""
    from . import beside, endings, hard_cases

    cases = hard_cases.listed(family)
    if list_cases:
        sys.stdout.writelines(f"{case.family}: {case.name}\n" for case in cases)
        return 0
    if json_file is not None and not json_file.absolute().parent.is_dir():
        raise CablecosimError(f"{json_file}: there is no such folder; give a file in a folder that exists", key=str(json_file))
    asked = hard_cases.peers(peers) if peers is not None else ()
    results = endings.gathered(cases, hard_cases.run(cases, kernels))
    answers = {peer: endings.gathered(cases, hard_cases.ask(peer, cases, kernels)) for peer in asked}
    sys.stdout.write(endings.table(results) + "\n" + beside.table(results, answers))
    if json_file is not None:
        json_file.write_text(endings.as_json(results, answers), encoding="utf-8")
    return int(any(result.is_silent for result in results))


@app.command
def accuracy(
    problem: Annotated[list[str] | None, Parameter(negative=(), help="One of the standard set, or a scene; may be given again.")] = None,
    *,
    out: Annotated[Path, Parameter(help="Folder for accuracy.json and accuracy.html.")] = Path("runs/accuracy"),
) -> int:
    """Show what accuracy costs in time: true errors of every model, mesh, tolerance, budget and effect set against CPU time."""
    from .children import run_to_its_end
    from .load import built_in

    out.mkdir(parents=True, exist_ok=True)
    report, measured = out / "accuracy.json", out / "scenes.json"
    scenes = [name for name in problem or STUDIED if name in built_in() or name.endswith(".toml")]
    words = ["study", "--json", str(report), *(word for name in problem or () if name not in scenes for word in ("--problem", name))]
    if scenes:
        from .scene_study import study_scenes

        measured.write_text(json.dumps(study_scenes(scenes)), encoding="utf-8")
        words += ["--measured", str(measured), *(["--nothing-else"] if problem and len(scenes) == len(problem) else [])]
    return run_to_its_end("shape_server.accuracy", words) or run_to_its_end("viz_client", ["--accuracy", str(report)])


@app.command
def paper(
    figure: Annotated[list[str] | None, Parameter(negative=(), help="Figures by their numbers, or touch_down; all unless given.")] = None,
    *,
    out: Annotated[Path | None, Parameter(help="A new folder for page, report and recordings; runs/paper-TIME unless given.")] = None,
    kernels: Annotated[Literal["auto", "compiled", "numpy"], Parameter(help="Solve by compiled kernels if ready, or as named.")] = "auto",
) -> int:
    """Reproduce the figures of the paper: run a scene for each in three processes, and put its claim beside what was measured.

    Exit code 1 if anything is not as the paper says.
    """
    from .paper.report import report

    return report(figure or (), out, kernels)


@app.command
def audit(
    *,
    cases: Annotated[int, Parameter(help="How many random requests.")] = 1000,
    json_file: Annotated[Path | None, Parameter(name="--json", help="Write every request with its error and time.")] = None,
) -> int:
    """Audit the price tags of random requests: are true errors below the estimates, are tolerances and budgets kept?"""
    from .children import run_to_its_end

    words = ["audit", "--cases", str(cases), *(["--json", str(json_file)] if json_file is not None else [])]
    return run_to_its_end("shape_server.accuracy", words)


@app.command
def effects(
    scene: SceneName = "harness_assembly",
    /,
    *,
    settings: Settings = None,
    json_file: Annotated[Path | None, Parameter(name="--json", help="Write every effect with its size and cost.")] = None,
) -> int:
    """Print what each effect of a scene's cables could change at the start, and what it costs when it is on."""
    from protocol.codec import encode

    from .children import run_to_its_end
    from .load import load
    from .start_request import start_request

    words = ["effects", *(["--json", str(json_file)] if json_file is not None else [])]
    return run_to_its_end("shape_server.accuracy", words, encode(start_request(load(scene, settings or ()))))


def _plural(word: str, count: int) -> str:
    return word if count == 1 else f"{word[:-1]}ies" if word.endswith("y") else f"{word}s"


def _say(text: str) -> None:
    sys.stderr.write(f"{text}\n")
