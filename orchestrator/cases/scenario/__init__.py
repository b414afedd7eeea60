"""One scenario of a case, prepared: its network, units, wiring, clock and operating point."""
