"""The plane: arrays and offsets, polylines, cubics, polygons, named parts. No stroke, no file."""
