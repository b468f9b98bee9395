"""Arrays that sounds calibrate: places of microphones and the speed of sound."""
