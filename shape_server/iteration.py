"""The iterations of `equilibrium` as compiled functions: settling, for a warm start, and both as one, for a cold start.

Each of them contains the whole Newton step, and to load it a second time would take a fresh process a tenth of a second; to compile it
again, half a minute.
"""

from __future__ import annotations

from .equilibrium import CLOSE, descend, settled_from
from .jitted import kernel


@kernel
def settle(rod, state, near):  # type: ignore[no-untyped-def]
    """See `equilibrium.settled_from`."""
    return settled_from(rod, state, near)


@kernel
def iterate(rod, descent, steps, settles):  # type: ignore[no-untyped-def]
    """`descend` by at most so many steps, then `settle` where that has come close to an equilibrium; or at once, without steps.

    Args:
        rod: The system.
        descent: Where it has come to.
        steps: Of the descent, at most.
        settles: False to leave settling to the caller.

    Returns:
        The descent, and where it settled; of no meaning where it is still going on, has failed or is not to settle.
    """
    if steps > 0:
        descent = descend(rod, descent, steps)
        if descent.settled.why != CLOSE or not settles:
            return descent, descent.settled
    return descent, settled_from(rod, descent.settled.state, 0.0)
