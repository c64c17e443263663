"""Strokes with their texture: what `render` makes, `edit` changes, and the SVG files keep."""
