"""Devices without actuators: the mock, and emulators on a pty or a port, with faults."""
