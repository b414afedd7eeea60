"""WECC's model REGFM_B1: a grid-forming inverter as a virtual synchronous machine."""
