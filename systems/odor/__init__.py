"""Wind, odour plume, and the sensors that feel them."""
