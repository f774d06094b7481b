"""Attitude data messages of CCSDS 504.0-B-2: content once, as in `message`; notations in `kvn` and `xml`."""
