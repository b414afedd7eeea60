"""Runs of a case's scenarios, with their modes, checkpoints and files."""
