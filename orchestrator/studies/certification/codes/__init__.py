"""Grid codes for grid-forming converters as tables of stimuli and criteria, judged on an operator's test bench."""
