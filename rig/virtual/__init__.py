"""Virtual devices: the same driver code runs on them and on the bench."""
