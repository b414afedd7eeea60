"""Induction machines: a stator behind its leakage, and one or two cages of the rotor."""
