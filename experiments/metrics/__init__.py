"""Distances between drawings, as papers state them: LPIPS, FID, KID, the same of patches, marks."""
