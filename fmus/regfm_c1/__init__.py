"""WECC's model REGFM_C1: a grid-forming and a grid-following branch in one inverter."""
