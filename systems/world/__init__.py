"""The plane that robots share: geometry, paths, bodies that move on them."""
