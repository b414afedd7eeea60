"""Networks of other programs: what their files hold, as elements of our network."""
