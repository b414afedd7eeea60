"""Networks of PSS/E: power flow data (RAW)."""
