"""The Python face: what ``import orchestrator as gfor`` gives. The command line is written on it as well."""
