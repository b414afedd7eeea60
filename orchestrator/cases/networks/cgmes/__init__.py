"""Networks of CGMES (CIM), read with pypowsybl."""
