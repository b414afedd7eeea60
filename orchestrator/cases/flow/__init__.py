"""Power flow: the balance of every bus, the equations, their solution, and who feeds what is missing."""
