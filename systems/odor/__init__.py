"""Wind, odor plume, and the sensors that measure them."""
