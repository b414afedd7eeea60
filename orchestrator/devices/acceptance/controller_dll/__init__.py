"""Conformity of a controller DLL with the IEEE/CIGRE interface."""
