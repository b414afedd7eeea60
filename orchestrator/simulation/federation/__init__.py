"""Components of a case in other processes or on other machines, over HELICS: .docs/how-to/federation.md."""
