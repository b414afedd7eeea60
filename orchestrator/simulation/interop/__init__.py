"""The masters of other tools: our master runs their schedules, and a pair of probe FMUs shows which schedule a tool
has."""
