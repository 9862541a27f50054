"""The names of the interval methods; imports nothing, so that ``--help`` stays fast."""

METHODS = ("wilson", "jeffreys", "clopper-pearson")
