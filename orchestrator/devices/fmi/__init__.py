"""FMUs: what their files declare, and one running instance."""
