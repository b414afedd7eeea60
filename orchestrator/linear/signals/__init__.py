"""Modes in recorded signals: ring-down and ambient identification, and doubts about them."""
