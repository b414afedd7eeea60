"""Whether a device is stable at a network: generalised Nyquist over scans, measured FMUs and linear models."""
