"""Electrical networks as FMUs: devices inject currents, the network answers with bus voltages."""
