"""Result files to one checked table."""
