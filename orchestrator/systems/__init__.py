"""Coupled systems: devices with their connections, and SSP archives of them."""
