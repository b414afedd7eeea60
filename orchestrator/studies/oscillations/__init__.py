"""Where an oscillation comes from: found, told apart, and located in phasors of runs and of measurements."""
