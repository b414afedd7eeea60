"""The paper's first case study with phasor models."""
