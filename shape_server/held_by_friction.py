"""Whether a cable that rubs is stable: what friction holds, and what it does not, compiled.

A contact that sticks is held both ways along the surface. One that slides pulls with a force along its slip, which holds nothing unless it
grows with the speed (by 1 / F' then), and turns that force where it is pushed aside: with F against a slip u it gives way across by
|u| / F. The descent, in which friction is a spring of that secant stiffness, ends where this says so.
"""

from __future__ import annotations

import numpy as np

from .jitted import kernel
from .symmetric import part, solve_symmetric


@kernel
def positive_and_held(matrix, held, closed, sticks, drag, slip, growth, hard):  # type: ignore[no-untyped-def]
    """Positive eigenvalues of the matrix of held points, closed contacts, curvature and what friction holds; the rows of the last.

    Args:
        matrix: (count, count) S, its last rows two of every contact that rubs.
        held: How many rows of held points there are.
        closed: (m,) Contacts that push, in the rows after those.
        sticks: (f,) Contacts that stick.
        drag: (2f,) [N] Forces along the surface.
        slip: (2f,) [m] Slips, less what the springs give way.
        growth: (f,) [N/m] How fast the force of what slides grows with its slip; not positive, and it does not count.
        hard: [m/N] Compliance of what sticks, which `matrix` holds already.
    """
    rubs, many, turned = len(sticks), len(closed), matrix.copy()
    last = len(matrix) - 2 * rubs
    is_kept = np.ones(len(matrix), dtype=np.bool_)
    is_kept[held : held + many] = closed
    rubbing = 0
    for k in range(rubs):
        along, across = last + 2 * k, last + 2 * k + 1
        f0, f1 = drag[2 * k], drag[2 * k + 1]
        size = np.hypot(f0, f1)
        grows = size > 0.0 and not sticks[k] and growth[k] > 0.0
        is_kept[along], is_kept[across] = sticks[k] or grows, sticks[k] or size > 0.0
        rubbing += (1 if is_kept[along] else 0) + (1 if is_kept[across] else 0)
        if size > 0.0 and not sticks[k]:
            for j in range(len(matrix)):
                first, second = turned[along, j], turned[across, j]
                turned[along, j], turned[across, j] = (f0 * first + f1 * second) / size, (f0 * second - f1 * first) / size
            for j in range(len(matrix)):
                first, second = turned[j, along], turned[j, across]
                turned[j, along], turned[j, across] = (f0 * first + f1 * second) / size, (f0 * second - f1 * first) / size
            turned[across, across] += max(np.hypot(slip[2 * k], slip[2 * k + 1]) / size - hard, 0.0)
            turned[along, along] += max(1.0 / growth[k] - hard, 0.0) if grows else 0.0
    kept = np.flatnonzero(is_kept)
    _, positive = solve_symmetric(part(turned, kept, kept), np.zeros((len(kept), 1)))
    return positive, rubbing
