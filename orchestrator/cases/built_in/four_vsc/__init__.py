"""The four-VSC benchmark of COLIB."""
