"""Voltage source behaviour of a device from its admittance: impedance, stiffness, passivity, strength, inertia."""
