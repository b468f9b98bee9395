"""What Sphinx needs besides, to make a site of these pages as they are."""
