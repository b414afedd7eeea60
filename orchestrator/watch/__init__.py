"""What a run does wrong in silence: each finding is said once, with its time and component."""
