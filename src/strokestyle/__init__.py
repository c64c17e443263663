"""Learn how an artist draws lines from one drawing of a 3D shape, and draw any other shape in that hand.

The alphabet of array axes, used in every signature, comment and error of this package:

    V  vertices        F  faces          N  curve or stroke points
    C  curves, strokes K  feature maps   B  batch
    H, W  pixels

Ragged data is flat rows plus `offsets` (C+1,): curve i is rows offsets[i]:offsets[i+1].
Image coordinates are pixels, x right, y down, (0, 0) the top-left corner of the image, pixel centres at +1/2.
The 3D world is right-handed; after `load_surface` a shape is centred and its longest side is 1.
Thickness is a stroke's full width in pixels. Angles are degrees at the command line and in `Camera.fov_y`.
"""

__version__ = "0.1.0"
