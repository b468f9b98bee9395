"""From a wanted heading to the wheels: compass, heading controller, motors."""
