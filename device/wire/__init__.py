"""The wire format of an own device, over serial ports and sockets: host's and device's end."""
