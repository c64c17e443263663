"""The page that shows drawings and plays with them."""
