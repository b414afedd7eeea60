"""An external grid: a voltage source behind the impedance of its short-circuit power."""
