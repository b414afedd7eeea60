"""Questions and refusals about values of a case that are most unusual, contradict each other or have no effect."""
