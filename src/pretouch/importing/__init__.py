"""An arm of your own: from its URDF or MJCF to a description that everything else takes."""
