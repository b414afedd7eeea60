"""Modes followed along one parameter or over a grid of them."""
