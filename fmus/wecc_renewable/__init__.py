"""WECC's generic models of wind, solar and battery plants: REGCA1 with REECA1 or REECB1, and REPCA1."""
