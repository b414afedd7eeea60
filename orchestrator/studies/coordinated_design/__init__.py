"""One setting of POD controllers for many operating points and outages."""
