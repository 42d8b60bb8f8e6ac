"""What a plan scans beside the gap: a magnet's rotation, an electromagnet's current."""
