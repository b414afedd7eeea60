"""Everything that users type: the Python interface, the command, the browser."""
