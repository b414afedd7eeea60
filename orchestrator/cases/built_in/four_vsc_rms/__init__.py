"""The four-VSC benchmark of COLIB with phasor models."""
