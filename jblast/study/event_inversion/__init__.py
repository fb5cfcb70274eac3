"""A blast's numbers from an event camera's film."""
