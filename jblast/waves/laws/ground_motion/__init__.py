"""P wave in the ground: peak displacement and velocity, by range and burial."""
