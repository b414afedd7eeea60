"""Studies: a case, what to compute of each scenario, and what comes out."""
