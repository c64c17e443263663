"""A mesh file becomes a Surface: read, repaired, split at creases, measured."""
