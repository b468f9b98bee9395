"""Control of the heading: compass, heading controller and motor driver."""
