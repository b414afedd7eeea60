"""Other people's masters: their schedules, run by ours, and how to tell which one a tool has."""
