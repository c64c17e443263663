"""Drawing and Curves -> SVG, and back."""
