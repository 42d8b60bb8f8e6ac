"""The twin's board: firmware and carriage."""
