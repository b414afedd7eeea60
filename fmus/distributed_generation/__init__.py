"""Distributed generation behind one bus: WECC's DER_A."""
