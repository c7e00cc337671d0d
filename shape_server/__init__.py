"""Boundary conditions in, cable shape out; no clock, no bodies, no memory."""
