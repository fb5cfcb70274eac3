"""The thesis as printed and as coded, written as a user's own law and load.

As printed: Parab 2024, eqs. 3.1 to 3.5, algorithm 4, section 4.2.1. As coded: facts
read from charlotte-visionlab/gazebo_blast3d, `e6dd04c` and its state of July 2025,
which is under the GPL: nothing is copied.
"""
