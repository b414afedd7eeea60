"""Screenings."""
