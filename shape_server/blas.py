"""BLAS and LAPACK for numba, without the rest of `scipy.linalg`.

Numba calls them through the addresses that two modules of SciPy keep, `scipy.linalg.cython_blas` and `cython_lapack`. To import these the
ordinary way imports all of `scipy.linalg`, and with it half of numpy's own extras: 0.15 s of every fresh process, for nothing. Here they
are loaded from their folder while a stand-in takes the place of their package; whoever imports `scipy.linalg` later gets all of it.

To import this file before the first compiled function runs is all there is to do. The programs of this package then call `use_one_thread`:
by the time that they run, BLAS is loaded with a thread for each core, and OPENBLAS_NUM_THREADS is no longer heard.
"""

from __future__ import annotations

import ctypes
import importlib
import sys
from pathlib import Path
from types import ModuleType
from typing import Final

import scipy

PACKAGE: Final = "scipy.linalg"


def use_one_thread() -> None:
    """Let the BLAS that comes with SciPy's wheels use one thread in this process; another one is left as it is.

    Matrices here are small. With two threads on two cores that other programs need as well, hard steps took ten times as long.
    """
    for library in (Path(scipy.__file__).parents[1] / "scipy.libs").glob("libscipy_openblas*"):
        ctypes.CDLL(str(library)).scipy_openblas_set_num_threads(1)


def _load() -> None:
    """Load both modules, unless `scipy.linalg` is there already."""
    if PACKAGE in sys.modules:
        return
    stand_in = ModuleType(PACKAGE)
    stand_in.__path__ = [str(Path(scipy.__file__).parent / "linalg")]
    sys.modules[PACKAGE] = stand_in
    try:
        importlib.import_module(f"{PACKAGE}.cython_blas")
        importlib.import_module(f"{PACKAGE}.cython_lapack")
    finally:
        del sys.modules[PACKAGE]
        vars(scipy).pop("linalg", None)  # where the import has put the stand-in


_load()
