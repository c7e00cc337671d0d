"""The paper, figure by figure: its claim, a scene that shows it, and what is measured from the recording of that scene.

How to add a figure:

1. Scenes `fig_N_WORD.toml` in this folder, with a leading comment as every scene has. `cablecosim run paper/fig_N_WORD` runs one alone.
2. A file `fig_N_WORD.py` with `FIGURE = Figure(...)` (see `figure.py`): what the paper claims, the takes (a scene, with `settings` as on
   the command line; several takes of one scene where only a number differs), and `measure`, which gets the recording of every take and
   returns phenomena, panels and a sentence of what differs and why. Figures that share takes share a file.
3. A row in `MODULES` below: the module, and the figures by their numbers in the paper, as they are asked for on the command line.
4. A test `tests/scenarios/test_paper_fig_N.py`, which asserts the phenomena.

`measure` sees recordings and nothing else: a panel is curves in the figure's own view (mostly x-z, metres), not a picture. What is to
be drawn in three dimensions is a `Screenshot`: give the take `pictures=True` and name the key posture. Several cables side by side
(apart in y) in one scene are one start of the three programs, which costs four seconds; several takes are several.
"""

from __future__ import annotations

from typing import Final

MODULES: Final[dict[str, tuple[str, ...]]] = {
    "fig_3_held": ("3",),
    "fig_4_drawn": ("4",),
    "fig_5_history": ("5",),
    "fig_6_distance": ("6",),
    "fig_7_motion": ("7",),
    "fig_10_11_inclination": ("10", "11"),
    "fig_12_measured": ("12",),
    "fig_13_self": ("13",),
    "fig_14_fictitious": ("14",),
    "fig_15_clip": ("15",),
    "fig_17_lost": ("16", "17"),
    "fig_18_case_study": ("18", "19", "20", "21", "22", "23", "24", "25", "26", "27"),
    "fig_28_harness": ("28", "29", "30"),
    "touch_down": ("touch_down",),
}
"""Modules of this folder, in the order of the paper, with the names by which they are asked for."""
