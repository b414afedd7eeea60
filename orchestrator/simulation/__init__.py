"""A prepared scenario in time: what a run does wrong, federates, other masters' schedules."""
