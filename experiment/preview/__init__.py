"""A study before anybody feels it: the check and the plate's field."""
