"""A person in front of a terminal or a window: pages, keys, answers."""
