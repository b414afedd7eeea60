"""How each parameter of each FMU moves a mode: ∂λ/∂p."""
