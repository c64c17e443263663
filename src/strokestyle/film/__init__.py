"""Drawings one after the other -> a film: GIF, APNG, WebP, MP4, a page."""
