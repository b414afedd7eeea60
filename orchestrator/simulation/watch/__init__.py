"""Faults of a run that raise no error, such as growth or lost synchronism. Each finding is reported once, with its time
and component."""
