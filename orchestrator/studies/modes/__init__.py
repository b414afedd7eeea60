"""Modes of a case's scenarios: their names, their linear models and the communication step."""
