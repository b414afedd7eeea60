"""The master: couples FMUs, finds their common operating point, linearises around it, and reports."""
