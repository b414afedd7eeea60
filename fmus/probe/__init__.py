"""Two small FMUs in a loop, whose trajectories tell which schedule a master runs."""
