"""The commands `init`, `check`, `bursts`, `field`, `run`, `export`, `verify` and `withdraw`."""
