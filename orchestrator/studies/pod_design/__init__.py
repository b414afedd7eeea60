"""Design of a power-oscillation damper: lead/lag, gain, refinement, margins."""
