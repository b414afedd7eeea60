"""FMUs of others: what their variables mean (bindings), and whether they can be trusted (checks)."""
