"""A device known only through FMI: its admittance, a model fitted to it, the modes of a system that it stands in."""
