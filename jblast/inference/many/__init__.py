"""The same fit for thousands to millions of logs."""
