"""Recordings in COMTRADE, the form in which fault recorders and phasor measurement units give them (IEEE C37.111)."""
