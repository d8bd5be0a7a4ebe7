"""Many problems: processes, resuming, summary."""
