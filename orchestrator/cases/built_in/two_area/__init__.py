"""The paper's first case study."""
