"""Static var compensators: a susceptance that holds the bus voltage."""
