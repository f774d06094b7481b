"""Nutation-damping planner for spinning spacecraft.

One stream runs through the package: spacecraft file -> Spacecraft -> scheme -> Schedule -> flight -> report.
"""

__version__ = "0.1.0"
