"""How long a run with federates waits for others before it gives them up."""

PATIENCE = 30.0  # how long a federate may take for one step, or one answer [s]
TO_JOIN = 60.0  # how long is waited for all federates to join [s]
HUB_GRACE = 10.0  # what the hub gets beyond its own patience [s]
TO_END = 10.0  # for a federate's process to end by itself [s]
AFTER_CTRL_C = 2.0  # how long Ctrl-C waits for the end of a step [s]
