"""The vehicle itself: parameters, named models, geometry, inertia."""
