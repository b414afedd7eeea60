"""WECC's model REGFM_A1: a droop-controlled grid-forming inverter for positive-sequence studies."""
