"""Small FMUs in C, good ones and faulty ones, built by the test suite."""
