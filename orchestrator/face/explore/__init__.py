"""``gfor explore``: a study in the browser, with the figures of the commands."""
