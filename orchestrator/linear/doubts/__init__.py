"""Examination of a linear model's verdict: comparison with the FMUs and with other steps."""
