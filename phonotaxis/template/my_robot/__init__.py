"""A law and a block for phonotaxis."""
