"""Fields of magnets: cuboid in closed form, remanence from readings."""
