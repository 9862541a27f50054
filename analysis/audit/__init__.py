"""Whether a printed table of proportions can be true."""
