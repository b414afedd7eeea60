"""The WSCC system of three machines and nine buses."""
