"""System Structure and Parameterization (SSP 1.0): a coupled system as one archive that other tools open."""
