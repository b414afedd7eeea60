"""The paper's second case study."""
