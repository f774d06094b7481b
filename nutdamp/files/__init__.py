"""Files in and out: spacecraft files (YAML, JSON), schedules, tracks and results."""
