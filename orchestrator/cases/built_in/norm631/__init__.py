"""The grid code's damping test: Norma técnica de supervisión 631, section 5.10."""
