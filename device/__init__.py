"""What drives the actuators: the driver protocol, its limits and the mock device."""
