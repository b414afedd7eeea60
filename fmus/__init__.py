"""Models of generators, networks and probes, and the toolchain that makes FMUs of models."""
