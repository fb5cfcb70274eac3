"""What `jblast calc` takes: options, numbers with units, and the question they make."""
