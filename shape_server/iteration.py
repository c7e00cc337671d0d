"""Both iterations of `equilibrium` as one compiled function, for a cold start, which needs both.

Each of them contains the whole Newton step, and to load it a second time would take a fresh process a tenth of a second.
"""

from __future__ import annotations

from numba import njit

from .equilibrium import CLOSE, descend, settle


@njit(cache=True, error_model="numpy")
def iterate(rod, descent, steps):  # type: ignore[no-untyped-def]
    """`descend` by at most so many steps, then `settle` where that has come close to an equilibrium; or at once, without steps.

    Returns:
        The descent, and where it settled; of no meaning where it is still going on or has failed.
    """
    if steps > 0:
        descent = descend(rod, descent, steps)
        if descent.settled.why != CLOSE:
            return descent, descent.settled
    return descent, settle(rod, descent.settled.state, 0.0)
