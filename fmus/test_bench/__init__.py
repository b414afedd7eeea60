"""An operator's test bench: a programmable source behind a settable impedance, a load, and two plants at one bus."""
