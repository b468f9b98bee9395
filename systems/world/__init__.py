"""The plane that the robots share: geometry, paths, and obstacles."""
