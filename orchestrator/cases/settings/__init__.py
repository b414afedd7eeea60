"""Who sets which value: parameter files, the scenario, the command line; imperfections of connections."""
