"""View + a drawing of it -> Style."""
