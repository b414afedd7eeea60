"""Stability of a device at a network: generalised Nyquist over scans, measured FMUs and linear models."""
