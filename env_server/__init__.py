"""Owns time and bodies: moves the robot, finds where the cable touches, and asks for its shape."""
