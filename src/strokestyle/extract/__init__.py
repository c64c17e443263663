"""Surface + Camera -> View: lines found, hidden parts cut away, tidied; feature maps."""
