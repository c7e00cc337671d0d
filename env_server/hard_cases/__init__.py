"""A catalogue of hard cases that take bodies, friction, steps, or a cable that meets itself, each with a reference or an invariant.

Each case is a scene, played by the environment's own loop. Besides what it measures, every step of it must be converged, finite and off
every body, its forces must balance, and no step may take the cable much further than what drives it but where a case expects a snap.
"""

from __future__ import annotations
