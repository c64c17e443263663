"""View + Style -> Drawing."""
