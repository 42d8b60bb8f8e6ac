"""Short scripts, one idea each; `magbend examples` copies them."""
