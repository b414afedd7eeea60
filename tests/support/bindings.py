"""Bindings of our own converter, as if it were somebody else's FMU."""

GFOR = """\
[rating]
S_n = "1500 MVA"
[voltage]
form = "rectangular"
variables = ["v_re", "v_im"]
[current]
form = "rectangular"
variables = ["i_re", "i_im"]
base = "100 MVA"
[start]
P_0 = { variable = "P_0" }
Q_0 = { variable = "Q_0" }
v_0 = { variable = "v_0" }
theta_0 = { variable = "theta_0" }
"""
"""Its rating stays as the binding says. Further tables, and further lines of ``[start]``, can be appended."""

GFOR_RATED = f'{GFOR}S_n = {{ variable = "S_n" }}\n'
"""The same, and its rating can be set."""
