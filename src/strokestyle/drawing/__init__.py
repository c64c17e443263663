"""The drawing that `render` makes, `edit` changes and `svg` keeps: strokes, outlines, ribbons, texture, pixels."""
