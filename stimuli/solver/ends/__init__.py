"""What free ends add to the field: waves turned back, fields fitted, singular corners."""
