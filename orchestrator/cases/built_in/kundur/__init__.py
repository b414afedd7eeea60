"""Kundur's example 12.6: two areas, four machines."""
