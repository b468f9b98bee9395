"""Ways through what a robot knows of the floor."""
