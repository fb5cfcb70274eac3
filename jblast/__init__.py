"""Differentiable blast physics: fit a blast from recordings, or simulate millions.

Open the folders in this order and you read the physics: `scene` what is there, `waves`
how it travels, `observations` what was measured, `sensors` what would be, `inference`
what we conclude, `report` what we print.
"""

__version__ = "0.2.0"
