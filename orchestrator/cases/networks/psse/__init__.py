"""Networks of PSS/E: power flow data (RAW) and dynamics data (DYR)."""
