"""Results as rich renderables and figures; nothing here prints."""
