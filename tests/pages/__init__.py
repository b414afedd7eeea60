"""README and pages: links lead somewhere, commands parse, code runs, guides work as written, the site builds."""
