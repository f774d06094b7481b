"""What the schemes share: models, builders of schedules, searches, and reasons."""
