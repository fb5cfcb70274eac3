"""Flights: one step, a scan of steps, a batch of scans."""
