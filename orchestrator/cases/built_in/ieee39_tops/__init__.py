"""New England's 39 buses as TOPS has them, beside PowerFactory's speeds after a short circuit."""
