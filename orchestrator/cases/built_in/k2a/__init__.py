"""Kundur's two areas as TOPS has them, beside PowerFactory's speeds after a short circuit."""
