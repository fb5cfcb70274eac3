"""The classes that Gymnasium makes; its library is an extra."""
