"""The command: one thin group per package; heavy imports only inside the commands."""
