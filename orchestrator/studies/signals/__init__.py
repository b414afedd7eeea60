"""Modes in recorded signals, and recordings side by side."""
