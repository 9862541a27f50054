"""The commands `init`, `check`, `field`, `run`, `export` and `withdraw`."""
