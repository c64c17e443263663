"""Views one after the other -> strokes that persist and move from frame to frame."""
