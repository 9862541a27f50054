"""The device's own logic, without a line: messages, states, tokens, outputs; and its host."""
