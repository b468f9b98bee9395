"""The blocks of robots that follow a sound, drive on a route, or search."""
