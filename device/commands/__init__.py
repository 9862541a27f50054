"""The commands `devices` and `emulate`."""
