"""The four-VSC benchmark with the network of BiGER's EMTP file."""
