"""Tests that network operators ask for: the damping test of the Norma técnica de supervisión 631."""
